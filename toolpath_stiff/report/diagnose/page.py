"""The results of a diagnosis: page and files."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.diagnosis.rows import percent_of
from toolpath_stiff.diagnosis.words import assumptions, beside_text, doubts, next_steps, verdict_text, why
from toolpath_stiff.files import Content
from toolpath_stiff.inference.errors import LAW_REFITTED, deviation_percent
from toolpath_stiff.report import explanations as words
from toolpath_stiff.report.diagnose.ladder import ladder_png
from toolpath_stiff.report.diagnose.pictures import confounding_png, detectable_png, envelope_png
from toolpath_stiff.report.diagnose.portrait import portrait_png, portrait_section
from toolpath_stiff.report.loops import loops_section
from toolpath_stiff.report.pages import bullets, hint_list, markup, page, picture, section, table
from toolpath_stiff.report.residuals import before_after_png
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, percent, plain, significant
from toolpath_stiff.units import deg_from_rad, json_number, mm_from_m, n_per_mm_from_n_per_m, number

text = words.text  # what a terminal shows


# Picture -> the question that it answers, and how it is read.
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
    "confounding.png": (
        "What can these data not tell apart?",
        "How alike two effects make these readings change, the strut law refitted: near 1 no fit can tell which of the "
        "two it is, whatever the noise. Other poses, loads or tools can.",
    ),
    "detectable.png": (
        "What could be there unseen?",
        "Smaller than this, an effect could be in the machine and these data would not show it.",
    ),
    "envelope.png": (
        "Is the model good enough as it is?",
        "Readings were simulated from the noise alone and went through the same fit.",
    ),
}


def diagnose_html(diagnosis: Diagnosis, pictures: Mapping[str, bytes]) -> str:
    """The page's text.

    Parameters
    ----------
    diagnosis
        The diagnosis.
    pictures
        File name -> PNG; those in `QUESTIONS` are shown.
    """
    about, beside = words.data_text(diagnosis), beside_text(diagnosis.unexcluded)

    def shown(name: str) -> Markup:
        return picture(name, pictures, QUESTIONS)

    sections = [
        section("Why", bullets(why(diagnosis))),
        shown("ladder.png"),
        section("What the missing thing looks like", portrait_section(diagnosis.portrait)),
        shown("portrait.png"),
        section("What the fits say", _candidates(diagnosis)),
        shown("before_after.png"),
        shown("confounding.png"),
        shown("detectable.png"),
        *loops_section(diagnosis.loops),
        section("What to measure or do next", _next(diagnosis)),
        section("What these data cannot test", _cannot_test(diagnosis)),
        section("How much the choice matters on the tool path", _path(diagnosis)),
        shown("envelope.png"),
        section("How much readings scatter", _noise(diagnosis)),
        section("Assumptions", bullets([*assumptions(diagnosis), *diagnosis.data.notes, *doubts(diagnosis)])),
    ]
    return page(
        title=f"Diagnosis: {about[1]}",
        verdict=diagnosis.verdict,
        headline=words.headline(diagnosis),
        text=" ".join(filter(None, (verdict_text(diagnosis), f"May be there beside it: {beside}." if beside else ""))),
        about=about,
        figures=_figures(diagnosis),
        warnings=diagnosis.predictor.data.warnings,
        sections=sections,
        footer=markup("<code>{}</code> seed {}", diagnosis.line, diagnosis.seed),
        verdict_class=diagnosis.verdict,
    )


def _figures(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """The few figures that say it all."""
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


def _candidates(diagnosis: Diagnosis) -> Markup:
    """As given, strut law refitted, pairs and all candidates."""
    cells = []
    for row in (diagnosis.rows.as_given, diagnosis.rows.refitted, *diagnosis.rows.pairs, *diagnosis.rows.candidates):
        sizes = Markup("<br>").join(markup('<span class="whole">{}</span>', size) for size in words.size_texts(row))
        texts = (
            markup("{}<small>{}</small>", row.label, row.finding or row.title),
            sizes or "-",
            words.probability_text(row.probability),
            percent(row.mean_abs_error_percent, 2),
            percent(row.held_out_error_percent, 2),
            "-" if row.held_out_gain_in_se is None else f"{row.held_out_gain_in_se:.1f}",
            "-" if row.adequate is None else "yes" if row.adequate else "no",
            words.remark_text(row),
        )
        cells.append(("plausible" if row.standing else "" if row.offered else "out", texts))
    head = ("effect", "size (95 % interval)", "probability", "mean error", "at points left out",
            "fall in standard errors", "leaves scatter only", "remark")  # fmt: skip
    return table(head, cells, range(2, 6))


def _next(diagnosis: Diagnosis) -> Markup:
    """What to do, and the readings that tell most."""
    readings = diagnosis.next_measurements
    keys = list(dict.fromkeys(key for reading in readings for key in reading if key != "why"))
    keys = [key for key in keys if any(reading.get(key) not in ("", None) for reading in readings)]
    rows = [("", [_cell(reading.get(key)) for key in (*keys, "why")]) for reading in readings]
    numeric = [i for i, key in enumerate(keys) if all(isinstance(r.get(key), int | float) for r in readings)]
    return hint_list(next_steps(diagnosis)) + table([*keys, "why"], rows, numeric)


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _cannot_test(diagnosis: Diagnosis) -> Markup:
    rows = []
    for name, lacks in sorted(diagnosis.cannot_test.items()):
        columns = Markup(", ").join(markup("<code>{}</code>", column) for column in lacks)
        rows.append(("", [name, columns or "nothing in these data depends on it"]))
    # 80 % power is what `detectable` asks for.
    never = "even at its largest possible size these data would show it less than four times in five"
    rows += [("", [words.hidden_name(smallest), never]) for smallest in diagnosis.detectable if not smallest.seen]
    return table(("effect", "the column that is missing"), rows)


def _path(diagnosis: Diagnosis) -> Markup:
    """What the plausible explanations predict on the path."""
    text = words.path_text(diagnosis.path)
    if diagnosis.path is None or not text:
        return Markup()
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
    explanations = diagnosis.path.get("explanations", {})
    rows = [("", [name, *(number(figures[key]) for key in keys)]) for name, figures in explanations.items()]
    listed = table(("explanation", "mean N/mm", "range N/mm", "weakest N/mm"), rows, (1, 2, 3))
    return markup("<p>{}.</p>", text[0].upper() + text[1:]) + listed


def _noise(diagnosis: Diagnosis) -> Markup:
    """Where the noise comes from, and the verdict under each guess."""
    noise = diagnosis.noise
    shares = (("repeats", noise.typical_repeat), ("clamping", noise.clamping),
              ("struts among themselves", noise.strut_spread))  # fmt: skip
    parts = [f"{name} {percent(percent_of(share, 4))}" for name, share in shares]
    parts.append(f"joints {significant(json_number(float(mm_from_m(noise.joint_error)), 4), 2)} mm")
    body = markup("<p>Standard deviations: {}. {}</p>", ", ".join(parts), noise.origin)
    rows = []
    for name, judged in diagnosis.judgements.items():
        likely = [f"{key} {words.probability_text(json_number(p, 4))}" for key, p in judged.likely if p > 1e-4]
        cells = [name, percent(percent_of(judged.noise.typical, 4)), judged.verdict]
        rows.append(("", [*cells, words.plausible_text(judged.plausible), ", ".join(likely[:4])]))
    body += table(("noise", "one reading", "verdict", "plausible", "probability"), rows, (1,))
    guess = "The noise is a guess: the verdict is what both guesses have in common."
    return body + markup('<p class="muted">{}</p>', guess) if len(rows) > 1 else body


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes; a picture that has nothing to show is left out."""
    data = ("diagnose.json", "residuals.csv")
    pictures = ("ladder.png", "portrait.png", "confounding.png", "detectable.png", "before_after.png", "envelope.png")
    return (*data, *pictures, "report.html") if plots else data


def files(diagnosis: Diagnosis, *, plots: bool = True) -> dict[str, Content]:
    """The document as JSON, one row a reading, and with `plots` the pictures that have something to show, and page."""
    contents: dict[str, Content] = {"diagnose.json": diagnosis.to_json(), "residuals.csv": residuals_csv(diagnosis)}
    if not plots:
        return contents
    base, best = diagnosis.rows.refitted, None if diagnosis.verdict == "adequate" else diagnosis.rows.best
    word = "best of the catalogue:" if diagnosis.verdict == "unexplained" else "with"
    before_after = before_after_png(
        diagnosis.data, diagnosis.before, diagnosis.after, f"{word} {plain(best.label)}" if best else LAW_REFITTED,
        (best or base).held_out_error_percent, base.mean_abs_error_percent if best else None,
    )  # fmt: skip
    pictures: dict[str, bytes | None] = {
        "ladder.png": ladder_png(diagnosis),
        "portrait.png": portrait_png(diagnosis.portrait, diagnosis.data),
        "confounding.png": confounding_png(diagnosis),
        "detectable.png": detectable_png(diagnosis),
        "before_after.png": before_after,
        "envelope.png": envelope_png(diagnosis.main.base_gate),
    }
    drawn = {name: picture for name, picture in pictures.items() if picture is not None}
    return {**contents, **drawn, "report.html": diagnose_html(diagnosis, drawn)}


def residuals_csv(diagnosis: Diagnosis) -> str:
    """One row a reading: measured, modelled as given, with the law refitted, with the best explanation."""
    data, residuals = diagnosis.data, (diagnosis.before, diagnosis.base.residual, diagnosis.after)
    models = ("as_given", "law_refitted", "after")
    head = [
        "file", "line", "point", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx", "dy", "dz",
        "stiffness_N_per_mm", *(f"{name}_N_per_mm" for name in models),
        *(f"{name}_deviation_percent" for name in models),
    ]  # fmt: skip
    measured = n_per_mm_from_n_per_m(data.stiffness)
    places = np.concatenate([mm_from_m(data.position), deg_from_rad(data.angles), data.direction], axis=1)
    modelled = np.stack([measured, *(measured * np.exp(-residual) for residual in residuals)], axis=1)
    deviations = np.stack([deviation_percent(residual) for residual in residuals], axis=1)
    rows = [
        [
            str(data.file[i]), int(data.line[i]), str(data.point[i]), *(f"{value:.6g}" for value in places[i]),
            *(f"{value:.1f}" for value in modelled[i]), *(f"{value:.3f}" for value in deviations[i]),
        ]
        for i in range(len(data))
    ]  # fmt: skip
    return csv_text(head, rows)
