"""The results of a diagnosis: page and files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.comparison.loop_readings import BesideTip
from toolpath_stiff.documents import Document
from toolpath_stiff.files import Content
from toolpath_stiff.inference.errors import deviation_percent
from toolpath_stiff.report.diagnose.pictures import confounding_png, detectable_png, envelope_png, ladder_png
from toolpath_stiff.report.diagnose.portrait import portrait_png, portrait_section
from toolpath_stiff.report.explanations import (
    HEADLINES,
    best_explanation,
    explanations,
    figure_of,
    floor_text,
    headline,
    hidden_name,
    is_offered,
    is_plausible,
    model_rows,
    name_text,
    parameter_texts,
    path_text,
    percent,
    plausible_text,
    probability_text,
    remark_text,
    row_name,
    significant,
)
from toolpath_stiff.report.explanations import text as explanations_text
from toolpath_stiff.report.loops import loops_section
from toolpath_stiff.report.pages import bullets, hint_list, markup, page, picture, section, table
from toolpath_stiff.report.residuals import before_after_png
from toolpath_stiff.report.words import DEVIATION, MINUS_IS_SOFTER, counted, machine_text
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m, number

if TYPE_CHECKING:
    from toolpath_stiff.diagnosis.result import Diagnosis


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


def diagnose_html(document: Document, pictures: Mapping[str, bytes]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        As in `diagnose.json`.
    pictures
        File name -> PNG; those in `QUESTIONS` are shown.
    """
    verdict, files = document["verdict"], ", ".join(document["data"])
    about = [counted(document["readings"], "reading"), files, f"machine {machine_text(document)}"]
    beside = document["not_excluded_text"]
    sections = [
        section("Why", bullets(document["why"])),
        picture("ladder.png", pictures, QUESTIONS),
        section("What the missing thing looks like", portrait_section(document)),
        picture("portrait.png", pictures, QUESTIONS),
        section("What the fits say", _candidates(document)),
        picture("before_after.png", pictures, QUESTIONS),
        picture("confounding.png", pictures, QUESTIONS),
        picture("detectable.png", pictures, QUESTIONS),
        *loops_section(BesideTip.read(document["loops"])),
        section("What to measure or do next", _next(document)),
        section("What these data cannot test", _cannot_test(document)),
        section("How much the choice matters on the tool path", _path(document)),
        picture("envelope.png", pictures, QUESTIONS),
        section("How much readings scatter", _noise(document)),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    return page(
        title=f"Diagnosis: {files}",
        verdict=verdict,
        headline=headline(document),
        text=" ".join(filter(None, (document["text"], f"May be there beside it: {beside}." if beside else ""))),
        about=about,
        figures=_figures(document),
        warnings=document["warnings"],
        sections=sections,
        footer=markup("<code>{}</code> seed {}", document["command"], document["seed"]),
        verdict_class=verdict if verdict in HEADLINES else "",
    )


def _figures(document: Document) -> list[tuple[str, str]]:
    """The few figures that say it all."""
    base = document["baseline"]
    best = best_explanation(document)
    key = "mean_abs_error_percent"
    found = [(percent(base["as_given"][key], 2), "mean error as given")]
    found.append((percent(figure_of(base, key), 2), "mean error, strut law refitted"))
    if best is not None and document["verdict"] in ("identified", "described", "ambiguous"):
        found.append((percent(figure_of(best, key), 2), f"mean error with {name_text(best)}"))
        found.append((percent(figure_of(best, "held_out_error_percent"), 2), "the same at points left out"))
    found.append((floor_text(document), "would be left by scatter alone"))
    standing = explanations(document)
    described = document["verdict"] == "described"
    remark = "are left standing" if len(standing) > 1 else "describes it" if described else "is the explanation"
    found.append((plausible_text(standing), remark) if standing else ("no effect", "of the catalogue is left standing"))
    return found


def _candidates(document: Document) -> Markup:
    """As given, strut law refitted, pairs and all candidates."""
    rows = []
    for entry in [*model_rows(document), *document["pairs"], *document["candidates"]]:
        name, title = row_name(entry), str(entry.get("finding") or entry.get("title") or "")
        gain = figure_of(entry, "held_out_gain_in_se")
        kind = "plausible" if is_plausible(entry, document) else "" if is_offered(entry, document) else "out"
        rows.append(
            (
                kind,
                (
                    markup("{}<small>{}</small>", name, title),
                    Markup("<br>").join(markup('<span class="whole">{}</span>', s) for s in parameter_texts(entry))
                    or "-",
                    probability_text(figure_of(entry, "probability")),
                    percent(figure_of(entry, "mean_abs_error_percent"), 2),
                    percent(figure_of(entry, "held_out_error_percent"), 2),
                    "-" if gain is None else f"{gain:.1f}",
                    {True: "yes", False: "no"}.get(entry.get("adequate"), "-"),
                    remark_text(entry),
                ),
            )
        )
    head = ("effect", "size (95 % interval)", "probability", "mean error", "at points left out",
            "fall in standard errors", "leaves scatter only", "remark")  # fmt: skip
    return table(head, rows, range(2, 6))


def _next(document: Document) -> Markup:
    """What to do, and the readings that tell most."""
    readings = document["next_measurements"]
    body = hint_list(document["next"])
    if readings:
        keys = list(dict.fromkeys(key for entry in readings for key in entry if key != "why"))
        keys = [key for key in keys if any(entry.get(key) not in ("", None) for entry in readings)]
        rows = [("", [*(_cell(entry.get(key)) for key in keys), _cell(entry.get("why"))]) for entry in readings]
        numeric = [i for i, key in enumerate(keys) if all(_is_number(entry.get(key)) for entry in readings)]
        body += table([*keys, "why"], rows, numeric)
    return body


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: object) -> str:
    if value is None:
        return Markup()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _cannot_test(document: Document) -> Markup:
    rows = []
    for entry in document["cannot_test"]:
        columns = Markup(", ").join(markup("<code>{}</code>", name) for name in entry["missing"])
        rows.append(("", [entry["effect"], columns or "nothing in these data depends on it"]))
    # 80 % power is what `detectable` asks for.
    never = "even at its largest possible size these data would show it less than four times in five"
    rows += [("", [hidden_name(e), never]) for e in document["detectable"] if not e["detectable"]]
    return table(("effect", "the column that is missing"), rows) if rows else Markup()


def _path(document: Document) -> Markup:
    """What the plausible explanations predict on the path."""
    text = path_text(document)
    if not text:
        return Markup()
    explanations = (document["path"] or {}).get("explanations") or {}
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
    rows = [("", [name, *(number(figure_of(one, key)) for key in keys)]) for name, one in explanations.items()]
    listed = table(("explanation", "mean N/mm", "range N/mm", "weakest N/mm"), rows, (1, 2, 3)) if rows else Markup()
    return markup("<p>{}.</p>", text[0].upper() + text[1:]) + listed


def _noise(document: Document) -> Markup:
    """Where the noise comes from, and the verdict under each guess."""
    noise = document["noise"]
    parts = [
        f"{word} {percent(value)}"
        for word, key in (("repeats", "repeat_percent"), ("clamping", "clamping_percent"),
                          ("struts among themselves", "strut_spread_percent"))
        if (value := figure_of(noise, key)) is not None
    ]  # fmt: skip
    if (joints := figure_of(noise, "joint_error_mm")) is not None:
        parts.append(f"joints {significant(joints, 2)} mm")
    body = markup("<p>Standard deviations: {}. {}</p>", ", ".join(parts), noise["origin"]) if parts else Markup()
    rows = []
    for name, judged in document["by_noise"].items():
        shown = [f"{key} {probability_text(value)}" for key, value in judged["probability"].items()]
        cells = [name, percent(judged["noise_percent"]), judged["verdict"], plausible_text(judged["plausible"])]
        rows.append(("", [*cells, ", ".join(shown[:4])]))
    body += table(("noise", "one reading", "verdict", "plausible", "probability"), rows, (1,))
    if len(rows) > 1:
        body += markup(
            '<p class="muted">{}</p>', "The noise is a guess: the verdict is what both guesses have in common."
        )
    return body


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes; a picture that has nothing to show is left out."""
    data = ("diagnose.json", "residuals.csv")
    pictures = ("ladder.png", "portrait.png", "confounding.png", "detectable.png", "before_after.png", "envelope.png")
    return (*data, *pictures, "report.html") if plots else data


def text(diagnosis: Diagnosis) -> str:
    """The diagnosis in some 25 lines."""
    return explanations_text(diagnosis.document)


def files(diagnosis: Diagnosis, *, plots: bool = True) -> dict[str, Content]:
    """The document as JSON, one row a reading, and with `plots` the pictures that have something to show, and page."""
    contents: dict[str, Content] = {"diagnose.json": diagnosis.to_json(), "residuals.csv": residuals_csv(diagnosis)}
    if not plots:
        return contents
    document = diagnosis.document
    pictures: dict[str, bytes | None] = {
        "ladder.png": ladder_png(document),
        "portrait.png": portrait_png(document, diagnosis.data, diagnosis.portrait),
        "confounding.png": confounding_png(document),
        "detectable.png": detectable_png(document),
        "before_after.png": before_after_png(document, diagnosis.data, diagnosis.before, diagnosis.after),
        "envelope.png": envelope_png(document),
    }
    drawn = {name: picture for name, picture in pictures.items() if picture is not None}
    return {**contents, **drawn, "report.html": diagnose_html(document, drawn)}


def residuals_csv(diagnosis: Diagnosis) -> str:
    """One row a reading: measured, modelled as given, with the law refitted, with the best explanation."""
    data = diagnosis.data
    models = ("as_given", "law_refitted", "after")
    head = [
        "file", "line", "point", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx", "dy", "dz",
        "stiffness_N_per_mm", *(f"{name}_N_per_mm" for name in models),
        *(f"{name}_deviation_percent" for name in models),
    ]  # fmt: skip
    rows = []
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        own = [float(r[i]) for r in (diagnosis.before, diagnosis.base.residual, diagnosis.after)]
        modelled = [measured * float(np.exp(-r)) for r in own]
        numbers = [f"{value:.6g}" for value in pose]
        numbers += [f"{value:.1f}" for value in (measured, *modelled)]
        numbers += [f"{float(deviation_percent(np.array(r))):.3f}" for r in own]
        rows.append([str(data.file[i]), int(data.line[i]), str(data.point[i]), *numbers])
    return csv_text(head, rows)
