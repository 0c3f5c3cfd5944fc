"""The results of a diagnosis: page, its section on what the missing thing looks like, and files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.files import Content
from toolpath_stiff.report import (
    DEVIATION,
    MINUS_IS_SOFTER,
    bullets,
    counted,
    hint_list,
    machine_text,
    markup,
    number,
    page,
    picture,
    plain,
    section,
    shortened,
    table,
)
from toolpath_stiff.report.diagnose.pictures import confounding_png, detectable_png, envelope_png, ladder_png
from toolpath_stiff.report.explanations import (
    HEADLINES,
    best_explanation,
    entries,
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
    text,
)
from toolpath_stiff.report.figure import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    RAPID_GREY,
    SECOND_ORANGE,
    Drawing,
    drawing,
    house_style,
    new_figure,
)
from toolpath_stiff.report.readings import before_after_png, loops_section
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m
from toolpath_stiff.updating.inference.fits import deviation_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from toolpath_stiff.updating.diagnosis import Diagnosis
    from toolpath_stiff.updating.diagnosis.document import DiagnosisDocument
    from toolpath_stiff.updating.measurements import Measurements
    from toolpath_stiff.updating.portrait import Portrait

__all__ = ["diagnose_html", "files", "names", "portrait_png", "portrait_section", "residuals_csv", "text"]


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
AXES = "XYZ"
COLOURS = (BLUE, SECOND_ORANGE, MUTED, RAPID_GREY)
MOST_BARS = 8


def diagnose_html(document: DiagnosisDocument, pictures: Mapping[str, bytes]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        As in `diagnose.json`.
    pictures
        File name -> PNG; those in `QUESTIONS` are shown.
    """
    verdict = str(document.get("verdict") or "-")
    files = ", ".join(str(name) for name in entries(document, "data"))
    readings = figure_of(document, "readings")
    about = [counted(readings, "reading") if readings is not None else "", files, f"machine {machine_text(document)}"]
    sections = [
        section("Why", bullets(entries(document, "why"))),
        picture("ladder.png", pictures, QUESTIONS),
        section("What the missing thing looks like", portrait_section(document)),
        picture("portrait.png", pictures, QUESTIONS),
        section("What the fits say", _candidates(document)),
        picture("before_after.png", pictures, QUESTIONS),
        picture("confounding.png", pictures, QUESTIONS),
        picture("detectable.png", pictures, QUESTIONS),
        *loops_section(document["loops"]),
        section("What to measure or do next", _next(document)),
        section("What these data cannot test", _cannot_test(document)),
        section("How much the choice matters on the tool path", _path(document)),
        picture("envelope.png", pictures, QUESTIONS),
        section("How much readings scatter", _noise(document)),
        section("Assumptions", bullets([*entries(document, "assumptions"), *entries(document, "notes")])),
    ]
    return page(
        title=f"Diagnosis: {files or verdict}",
        verdict=verdict,
        headline=headline(document),
        text=" ".join(filter(None, (document.get("text"), _beside(document)))),
        about=about,
        figures=_figures(document),
        warnings=entries(document, "warnings"),
        sections=sections,
        footer=markup("<code>{}</code> seed {}", document.get("command") or "", document.get("seed", "-")),
        verdict_class=verdict if verdict in HEADLINES else "",
    )


def _figures(document: DiagnosisDocument) -> list[tuple[str, str]]:
    """The few figures that say it all."""
    base = document["baseline"]
    best = best_explanation(document)
    key = "mean_abs_error_percent"
    found = [(percent(figure_of(base.get("as_given"), key), 2), "mean error as given")]
    found.append((percent(figure_of(base, key), 2), "mean error, strut law refitted"))
    if best is not None and document.get("verdict") in ("identified", "described", "ambiguous"):
        found.append((percent(figure_of(best, key), 2), f"mean error with {name_text(best)}"))
        found.append((percent(figure_of(best, "held_out_error_percent"), 2), "the same at points left out"))
    found.append((floor_text(document), "would be left by scatter alone"))
    standing = explanations(document)
    described = document.get("verdict") == "described"
    remark = "are left standing" if len(standing) > 1 else "describes it" if described else "is the explanation"
    found.append((plausible_text(standing), remark) if standing else ("no effect", "of the catalogue is left standing"))
    return found


def _candidates(document: DiagnosisDocument) -> Markup:
    """As given, strut law refitted, pairs and all candidates."""
    rows = []
    for entry in [*model_rows(document), *entries(document, "pairs"), *entries(document, "candidates")]:
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


def _next(document: DiagnosisDocument) -> Markup:
    """What to do, and the readings that tell most."""
    readings = [entry for entry in entries(document, "next_measurements") if isinstance(entry, Mapping)]
    body = hint_list(entries(document, "next"))
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


def _cannot_test(document: DiagnosisDocument) -> Markup:
    rows = []
    for entry in entries(document, "cannot_test"):
        columns = Markup(", ").join(markup("<code>{}</code>", name) for name in entry.get("missing") or [])
        rows.append(("", [str(entry.get("effect", "?")), columns or "nothing in these data depends on it"]))
    # 80 % power is what `detectable` asks for.
    never = [e for e in entries(document, "detectable") if isinstance(e, Mapping) and e.get("detectable") is False]
    rows += [
        (
            "",
            [
                hidden_name(e),
                "even at its largest possible size these data would show it less than four times in five",
            ],
        )
        for e in never
    ]
    return table(("effect", "the column that is missing"), rows) if rows else Markup()


def _path(document: DiagnosisDocument) -> Markup:
    """What the plausible explanations predict on the path."""
    text = path_text(document)
    if not text:
        return Markup()
    explanations = (document.get("path") or {}).get("explanations") or {}
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm")
    rows = [("", [name, *(number(figure_of(one, key)) for key in keys)]) for name, one in explanations.items()]
    listed = table(("explanation", "mean N/mm", "range N/mm", "weakest N/mm"), rows, (1, 2, 3)) if rows else Markup()
    return markup("<p>{}.</p>", text[0].upper() + text[1:]) + listed


def _noise(document: DiagnosisDocument) -> Markup:
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
    origin = str(noise.get("origin") or "")
    body = markup("<p>Standard deviations: {}. {}</p>", ", ".join(parts), origin) if parts else Markup()
    found = document.get("by_noise") or {}
    if found:
        rows = []
        for name, one in found.items():
            likely = one.get("probability")
            shown = [f"{key} {probability_text(value)}" for key, value in likely.items()] if likely else []
            rows.append(
                ("", [str(cell) for cell in (
                    name, percent(figure_of(one, "noise_percent")), one.get("verdict", "-"),
                    plausible_text(one.get("plausible") or []), ", ".join(shown[:4]),
                )])
            )  # fmt: skip
        body += table(("noise", "one reading", "verdict", "plausible", "probability"), rows, (1,))
    if len(found) > 1:
        body += markup(
            '<p class="muted">{}</p>', "The noise is a guess: the verdict is what both guesses have in common."
        )
    return body


def names(plots: bool = True) -> tuple[str, ...]:
    """Names of the files that `files` makes; a picture that has nothing to show is left out."""
    data = ("diagnose.json", "residuals.csv")
    pictures = ("ladder.png", "portrait.png", "confounding.png", "detectable.png", "before_after.png", "envelope.png")
    return (*data, *pictures, "report.html") if plots else data


def files(diagnosis: Diagnosis, document: DiagnosisDocument, *, plots: bool = True) -> dict[str, Content]:
    """`document` as JSON, one row a reading, and with `plots` pictures and page."""
    contents: dict[str, Content] = {
        "diagnose.json": json.dumps(document, indent=2, ensure_ascii=False) + "\n",
        "residuals.csv": residuals_csv(diagnosis),
    }
    return contents | (_pictures(document, diagnosis) if plots else {})


def _pictures(document: DiagnosisDocument, diagnosis: Diagnosis) -> dict[str, Content]:
    """The pictures that have something to show, and the page with them."""
    pictures: dict[str, bytes | None] = {
        "ladder.png": ladder_png(document),
        "portrait.png": portrait_png(document, diagnosis.data, diagnosis.portrait),
        "confounding.png": confounding_png(document),
        "detectable.png": detectable_png(document),
        "before_after.png": before_after_png(document, diagnosis.data, diagnosis.before, diagnosis.after),
        "envelope.png": envelope_png(document),
    }
    drawn = {name: picture for name, picture in pictures.items() if picture is not None}
    return {**drawn, "report.html": diagnose_html(document, drawn)}


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


def portrait_section(document: DiagnosisDocument) -> Markup:
    """The portrait in words, its terms, and what else would look the same; nothing where there is none."""
    portrait = document.get("portrait")
    if not portrait:
        return Markup()
    body = markup("<p>{}</p>", portrait["text"])
    rows = [("", [*_row(one), "1"]) for one in entries(portrait, "terms")]
    rows[1:] = [("", [*cells[:-1], "beside it"]) for _, cells in rows[1:]]
    rows[:1] = [("plausible", [*cells[:-1], "leading"]) for _, cells in rows[:1]]
    rows += [
        ("", [*_row(one), f"instead, {probability_text(figure_of(one, 'probability'))}"])
        for one in entries(portrait, "indistinguishable")
    ]
    if not rows:
        return body
    head = ("what gives way", "link", "varies with", "size (95 % interval)", "change of stiffness", "part")
    return body + table(head, rows, (4,))


def _row(one: Mapping[str, Any]) -> list[str]:
    low, high = (significant(end, 3) for end in one["interval"])
    size = f"{significant(one['size'], 3)} {one['unit']} ({low} to {high})"
    return [
        str(one["words"]), str(one["link"]), f"{one['variable']} ({one['shape']})", size,
        percent(figure_of(one, "rms_percent")),
    ]  # fmt: skip


def _beside(document: DiagnosisDocument) -> str:
    """What the readings neither show nor exclude, as a sentence of the page."""
    said = document.get("not_excluded_text")
    return f"May be there beside it: {said}." if said else ""


def portrait_png(document: DiagnosisDocument, data: Measurements, portrait: Portrait | None) -> Drawing | None:
    """PNG: what is left of the readings over what the leading term varies with; how surely it is which link."""
    if portrait is None or not portrait.terms or portrait.before is None or portrait.after is None:
        return None
    entry = document["portrait"]
    assert entry is not None
    with house_style():
        figure = new_figure(14.0, 5.4)
        figure.text(0.25 / 14.0, 1.0 - 0.4 / 5.4, "What does the missing thing look like?", fontsize=14, weight="bold")
        note = shortened(plain(f"leading: {entry['terms'][0]['words']}"), 150)
        figure.text(0.25 / 14.0, 1.0 - 0.68 / 5.4, note, fontsize=9.5, color=MUTED)
        left, right = figure.add_axes((0.055, 0.115, 0.56, 0.685)), figure.add_axes((0.765, 0.115, 0.2, 0.685))
        _points(left, data, portrait)
        _bars(right, entry["links"], entry["variables"])
        return drawing(figure)


def _points(axes: Axes, data: Measurements, portrait: Portrait) -> None:
    """Every reading before (hollow) and after (dots), over the variable or, of a constant, over the term's change."""
    from toolpath_stiff.updating.portrait import variable_label

    assert portrait.before is not None and portrait.after is not None and portrait.signature is not None
    label, si = variable_label(portrait.terms[0].term)
    across = portrait.values
    if across is None:
        across, label, si = np.expm1(portrait.signature), "change of stiffness by the leading term, %", 0.01
    across = across / si
    before, after = deviation_percent(portrait.before), deviation_percent(portrait.after)
    for k, rows in enumerate(_by_direction(data)):
        if not rows.any():
            continue
        name = f"along {AXES[k]}" if k < 3 else "oblique"
        axes.plot(across[rows], before[rows], "o", mfc="none", mec=COLOURS[k], ms=5.5, mew=1.1, zorder=3, label=name)
    axes.plot(across, after, ".", color=FAINT, ms=4, zorder=2, label="left with the description")
    axes.axhline(0.0, color=INK, lw=0.8, zorder=1)
    axes.set_xlabel(label)
    axes.set_ylabel("(measured - modelled) / modelled, %")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, fontsize=9, frameon=False)
    axes.annotate(
        MINUS_IS_SOFTER, (0.0, 1.0), xycoords="axes fraction", xytext=(0, 5), textcoords="offset points", size=9,
        color=MUTED,
    )  # fmt: skip
    axes.spines[["top", "right"]].set_visible(False)


def _by_direction(data: Measurements) -> list[NDArray[np.bool_]]:
    """Readings along X, Y, Z, and others."""
    along = [np.abs(data.direction[:, k]) > 0.999 for k in range(3)]
    return [*along, ~np.any(along, axis=0)]


def _bars(axes: Axes, links: Sequence[Mapping[str, Any]], variables: Sequence[Mapping[str, Any]]) -> None:
    """Probabilities of links and variables."""
    rows = [(str(one["link"]), one["probability"], BLUE) for one in links]
    rows += [(str(one["variable"]), one["probability"], SECOND_ORANGE) for one in variables]
    if not links:
        rows.insert(0, ("link cannot be told", 0.0, BLUE))
    rows = rows[:MOST_BARS]
    axes.barh(range(len(rows)), [value or 0.0 for _, value, _ in rows], height=0.55, color=[c for *_, c in rows])
    for y, (_, value, _) in enumerate(rows):
        axes.annotate(
            probability_text(value), (value or 0.0, y), xytext=(4, 0), textcoords="offset points", va="center", size=9
        )
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows], color=INK)
    axes.set_ylim(max(len(rows), 5) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.15)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"])
    axes.set_title(
        "which link (blue), what it varies with (orange)", size=9.5, loc="right", color=MUTED, weight="normal"
    )
    axes.grid(visible=False, axis="y")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
