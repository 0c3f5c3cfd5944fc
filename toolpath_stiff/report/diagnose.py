"""The page of a diagnosis, and its residuals as a table."""

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from toolpath_stiff.diagnosis.document import document_of
from toolpath_stiff.diagnosis.examination import Diagnosis, percent_of
from toolpath_stiff.diagnosis.words import assumptions, beside_text, doubts, next_steps, verdict_text, why
from toolpath_stiff.documents import json_number, number
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.inference.votes import chance_of_losing, outvoted, standard_error
from toolpath_stiff.portrait.portrait import Portrait, Sized
from toolpath_stiff.portrait.words import portrait_text, term_words
from toolpath_stiff.report import explanations as words
from toolpath_stiff.report.loops import loops_section
from toolpath_stiff.report.pages import Head, Part, Section, hints, markup, page_of
from toolpath_stiff.report.residuals import residual_rows
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, percent, plain, significant
from toolpath_stiff.units import mm_from_m, n_per_mm_from_n_per_m

text = words.text  # the view's text for the terminal
document = document_of  # what diagnose.json holds
PAGE = "report.html"
# Picture -> the question that it answers, and how to read it.
QUESTIONS = {
    "ladder.png": (
        "Which effect explains the data, and how surely?",
        "Every effect is fitted together with the strut law. The error at points that the fit has not seen falls only "
        "if the effect carries over from point to point; the noise floor is what scatter alone would leave.",
    ),
    "portrait.png": (
        "What does the missing thing look like?",
        "Circles: what the model leaves of every reading, over what the missing thing varies with; dots: what is left "
        "with the description. Bars: how probable each link of the load path and each variable is.",
    ),
    "before_after.png": (
        "Where does the model fail, and what is left?",
        f"{DEVIATION}, {MINUS_IS_SOFTER} (red); blue: stiffer. A pattern points to physics, colours sprinkled at "
        "random to scatter.",
    ),
}


def page(diagnosis: Diagnosis, drawn: Mapping[str, bytes]) -> str:
    """The page, with the pictures in it."""
    about, beside = words.data_text(diagnosis), beside_text(diagnosis.beside)
    head = Head(
        title=f"Diagnosis: {about[1]}",
        verdict=diagnosis.verdict,
        headline=words.headline(diagnosis),
        text=" ".join(filter(None, (verdict_text(diagnosis), f"May be there beside it: {beside}." if beside else ""))),
        about=about,
        figures=_figures(diagnosis),
        warnings=diagnosis.predictor.data.warnings,
        footer=markup("<code>{}</code> seed {}", diagnosis.line, diagnosis.seed),
        verdict_class=diagnosis.verdict,
    )
    sections: list[Section] = [
        ("Why", why(diagnosis)),
        "ladder.png",
        ("What the missing thing looks like", *_portrait(diagnosis.portrait)),
        "portrait.png",
        ("What the fits say", _candidates(diagnosis)),
        ("How the readings vote", *_votes(diagnosis)),
        "before_after.png",
        ("What could be there unseen?", *_unseen(diagnosis)),
        loops_section(diagnosis.loops),
        ("What to measure or do next", hints(next_steps(diagnosis)), _next_readings(diagnosis)),
        ("What these data cannot test", _cannot_test(diagnosis)),
        ("How much the choice matters on the tool path", *_path(diagnosis)),
        ("How much readings scatter", *_noise(diagnosis)),
        ("Assumptions", [*assumptions(diagnosis), *diagnosis.data.notes, *doubts(diagnosis)]),
    ]
    return page_of(head, sections, drawn, QUESTIONS)


def _figures(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    rows, standing = diagnosis.rows, diagnosis.explanations
    figures = [
        (percent(rows.as_given.mean_abs_error_percent, 2), "mean error as given"),
        (percent(rows.refitted.mean_abs_error_percent, 2), "mean error, strut law refitted"),
    ]
    if rows.best is not None and diagnosis.verdict in ("identified", "described", "ambiguous"):
        figures.append((percent(rows.best.mean_abs_error_percent, 2), f"mean error with {plain(rows.best.label)}"))
        figures.append((percent(rows.best.held_out_error_percent, 2), "the same at points left out"))
    figures.append((words.floor_text(diagnosis), "would be left by scatter alone"))
    alone = "describes it" if diagnosis.verdict == "described" else "is the explanation"
    remark = "are left standing" if len(standing) > 1 else alone
    none = ("no effect", "of the catalogue is left standing")
    return [*figures, (words.plausible_text(standing), remark) if standing else none]


def _candidates(diagnosis: Diagnosis) -> ShownTable:
    every, rows, kinds = diagnosis.rows, [], []
    for row in (every.as_given, every.refitted, *every.pairs, *every.candidates):
        sizes = Markup("<br>").join(markup('<span class="whole">{}</span>', size) for size in words.size_texts(row))
        kinds.append("plausible" if row.standing else "" if row.offered else "out")
        rows.append(
            (
                markup("{}<small>{}</small>", row.label, row.finding or row.title),
                sizes or "-",
                words.probability_text(row.probability),
                percent(row.mean_abs_error_percent, 2),
                percent(row.held_out_error_percent, 2),
                "-" if row.held_out_gain_in_se is None else f"{row.held_out_gain_in_se:.1f}",
                "-" if row.adequate is None else "yes" if row.adequate else "no",
                words.remark_text(row),
            )
        )
    head = ("effect", "size (95 % interval)", ">probability", ">mean error", ">at points left out",
            ">fall in standard errors", "leaves scatter only", "remark")  # fmt: skip
    return ShownTable(head, rows, kinds)


def _votes(diagnosis: Diagnosis) -> list[Part]:
    rows = []
    for rival, votes in diagnosis.main.votes.items():
        chance = words.probability_text(chance_of_losing(votes))
        gain = f"{votes.sum():.1f} +- {standard_error(votes):.1f}"
        rows.append((rival, gain, chance, "outvoted" if outvoted(votes) else "not beyond chance"))
    first = next((name for name in diagnosis.explanations if name in diagnosis.fits), "")
    remark = (
        f"By how much {plain(first)} predicts pose after pose better than each rival of another part: log "
        "probability, summed over the poses; and how often not, in draws of the poses. A name needs all of these."
    )
    return [remark if rows else "", ShownTable(("rival", ">gain", ">chance of none", ""), rows)]


def _portrait(portrait: Portrait | None) -> list[Part]:
    if portrait is None:
        return []
    rows = [_sized(sized, "beside it" if place else "leading") for place, sized in enumerate(portrait.terms)]
    rows += [
        _sized(sized, f"instead, {words.probability_text(json_number(sized.probability or 0.0, 3))}")
        for sized in portrait.alike
    ]
    head = ("what gives way", "link", "varies with", "size (95 % interval)", ">change of stiffness", "part")
    kinds = ["plausible" if portrait.terms and not place else "" for place in range(len(rows))]
    return [markup("<p>{}</p>", portrait_text(portrait)), ShownTable(head, rows, kinds)]


def _sized(sized: Sized, part: str) -> list[str]:
    term = sized.term
    size, low, high = (significant(json_number(value / term.si)) for value in (term.size, *sized.interval))
    change = percent(json_number(100.0 * sized.rms, 3))
    kind = f"{term.variable} ({term.shape})"
    return [term_words(term), term.link, kind, f"{size} {term.unit} ({low} to {high})", change, part]


def _unseen(diagnosis: Diagnosis) -> list[Part]:
    rows = [
        (words.bound_name(hidden), words.bound_text(hidden), percent(percent_of(hidden.rms)))
        for hidden in sorted(diagnosis.unexcluded, key=lambda hidden: -round(hidden.rms, 9))
    ]
    remark = "Larger ones are excluded (95 %) beside the likeliest explanation, smaller ones are not."
    return [ShownTable(("effect", ">at most", ">change of stiffness, rms"), rows), remark if rows else ""]


def _next_readings(diagnosis: Diagnosis) -> ShownTable:
    readings = diagnosis.next_measurements
    keys = list(dict.fromkeys(key for reading in readings for key in reading if key != "why"))
    keys = [key for key in keys if any(reading.get(key) not in ("", None) for reading in readings)]
    rows = [[_cell(reading.get(key)) for key in (*keys, "why")] for reading in readings]
    figures = [all(isinstance(reading.get(key), int | float) for reading in readings) for key in keys]
    return ShownTable([*(f"{'>' * right}{key}" for key, right in zip(keys, figures, strict=True)), "why"], rows)


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _cannot_test(diagnosis: Diagnosis) -> ShownTable:
    rows = []
    for name, lacks in sorted(diagnosis.cannot_test.items()):
        columns = Markup(", ").join(markup("<code>{}</code>", column) for column in lacks)
        rows.append((name, columns or "nothing in these data depends on it"))
    return ShownTable(("effect", "the column that is missing"), rows)


def _path(diagnosis: Diagnosis) -> list[Part]:
    text = words.path_text(diagnosis.path)
    if diagnosis.path is None or not text:
        return []
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
    explanations = diagnosis.path.get("explanations", {})
    rows = [(name, *(number(figures[key]) for key in keys)) for name, figures in explanations.items()]
    listed = ShownTable(("explanation", ">mean N/mm", ">range N/mm", ">weakest N/mm"), rows)
    return [markup("<p>{}.</p>", text[0].upper() + text[1:]), listed]


def _noise(diagnosis: Diagnosis) -> list[Part]:
    noise = diagnosis.noise
    names, shares = ("repeats", "clamping", "struts among themselves"), (
        noise.typical_repeat, noise.clamping, noise.strut_spread
    )  # fmt: skip
    parts = [f"{name} {percent(percent_of(share, 4))}" for name, share in zip(names, shares, strict=True)]
    parts.append(f"joints {significant(json_number(float(mm_from_m(noise.joint_error)), 4), 2)} mm")
    rows = []
    for name, judged in diagnosis.judgements.items():
        likely = [f"{key} {words.probability_text(json_number(p, 4))}" for key, p in judged.likely if p > 1e-4]
        reading, plausible = percent(percent_of(judged.noise.typical, 4)), words.plausible_text(judged.plausible)
        rows.append((name, reading, judged.verdict, plausible, ", ".join(likely[:4])))
    return [
        markup("<p>Standard deviations: {}. {}</p>", ", ".join(parts), noise.origin),
        ShownTable(("noise", ">one reading", "verdict", "plausible", "probability"), rows),
        "The noise is a guess: the verdict is what both guesses have in common." if len(rows) > 1 else "",
    ]


def residuals_csv(diagnosis: Diagnosis) -> str:
    """One row per reading: measured, modelled as given, with the law refitted, with the best explanation."""
    measured = n_per_mm_from_n_per_m(diagnosis.data.stiffness)
    steps = (diagnosis.as_given.residual, diagnosis.base.residual, diagnosis.after)
    residuals = dict(zip(("as_given", "law_refitted", "after"), steps, strict=True))
    figures = {
        "stiffness_N_per_mm": (measured, ".1f"),
        **{f"{name}_N_per_mm": (measured * np.exp(-residual), ".1f") for name, residual in residuals.items()},
        **{f"{name}_deviation_percent": (deviation_percent(r), ".3f") for name, r in residuals.items()},
    }
    return residual_rows(diagnosis.data, {}, figures)


DATA = {"diagnose.json": Diagnosis.to_json, "residuals.csv": residuals_csv}
