"""The results of an update: page, files, text, and pictures (error step by step, the paper's Figure 3)."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.files import Content
from toolpath_stiff.machine import machine_toml
from toolpath_stiff.report import (
    DEVIATION,
    MINUS_IS_SOFTER,
    bullets,
    counted,
    hint_list,
    machine_text,
    markup,
    number,
    picture,
    plain,
    readings_page,
    section,
    shortened,
    table,
)
from toolpath_stiff.report.explanations import figure_of, percent, significant
from toolpath_stiff.report.figure import (
    BLUE,
    INK,
    MUTED,
    SECOND_ORANGE,
    WITHIN,
    drawn,
    house_style,
    new_figure,
)
from toolpath_stiff.report.readings import before_after_png
from toolpath_stiff.updating.correction import bar_curve_csv
from toolpath_stiff.updating.correction.document import residuals_csv

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.machine import Machine
    from toolpath_stiff.updating.correction import BarCurve
    from toolpath_stiff.updating.correction.document import LawEntry, StepEntry, UpdateDocument
    from toolpath_stiff.updating.correction.ladder import Update

VERDICTS = {
    "updated": "The machine is updated",
    "refused": "Refused: the data do not support it",
    "forced": "Added by force",
    "nothing added": "Nothing to add",
}

# Picture -> the question that it answers, and how it is read.
QUESTIONS = {
    "ladder.png": (
        "What does each step do to the error?",
        "From the machine file as given over its refitted strut law to the last model. What counts is the error at "
        "left-out points, which the fit has not seen. A fit weighs readings by their scatter, so that a step can raise "
        "this mean. Effects that only together lower it are one step. Bars: standard error of the step; an error below "
        "the noise floor is chance.",
    ),
    "before_after.png": (
        "Did the error fall, and what remains?",
        f"{DEVIATION}, {MINUS_IS_SOFTER} (red); blue: stiffer; both halves on one colour scale. A pattern that remains "
        "is something else that the model lacks.",
    ),
    "figure3.png": (
        "How stiff must the platform be taken?",
        "The paper: above 1e10 N/m a stiffer platform changes nothing. With the strut law refitted for each, "
        "the curve is all but flat: these readings cannot tell a soft platform from soft struts.",
    ),
}


def update_html(document: UpdateDocument, pictures: Mapping[str, bytes | str]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        Content of update.json.
    pictures
        File name -> PNG; they are put into the page.
    """
    provenance = document["provenance"]
    record = [
        f"command: {provenance['command']}",
        f"SHA-256 of the data: {provenance['data_sha256']}",
        f"machine file: {document['machine_file'] or 'none written'}",
    ]
    sections = [
        *(picture(name, pictures, QUESTIONS) for name in QUESTIONS),
        section("Errors by direction", _by_direction(document)),
        section("What was fitted", _fitted(document)),
        section("Do the data support it?", _support(document)),
        section("What to do next", hint_list(document.get("next") or [])),
        section("Where it comes from", bullets(record)),
        section("Assumptions", bullets([*document["assumptions"], *document["notes"]])),
    ]
    verdict = VERDICTS[document["verdict"]]
    return readings_page("Update", "update", document, verdict, _headline(document), _figures(document), sections)


def _headline(document: UpdateDocument) -> str:
    first, last = document["steps"][0], document["steps"][-1]
    if document["verdict"] == "nothing added":
        return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, and nothing to add"
    if last["findings"] and document["verdict"] in ("updated", "forced"):
        cause = "; ".join(last["findings"])
        return cause[0].upper() + cause[1:] + (" (described, not confirmed)" if document["described"] else "")
    return f"Mean error {first['mean_abs_error_percent']:.2f} % as given, {last['mean_abs_error_percent']:.2f} % after"


def _figures(document: UpdateDocument) -> list[tuple[str, str]]:
    last = document["steps"][-1]
    found = [(_percent(document["steps"][0]["mean_abs_error_percent"]), "mean error as given")]
    if document["objective"] == "likelihood":
        found.append(
            (_percent(document["strut_law_refitted"]["mean_abs_error_percent"]), "mean error, strut law refitted")
        )
    if last["effects"] or document["objective"] != "likelihood":
        called = f"mean error with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
        found.append((_percent(last["mean_abs_error_percent"]), called))
    found.append((_percent(last["held_out_error_percent"]), "the same at left-out points"))
    found.append((_percent(document["noise_floor_percent"]), "would be left by scatter alone"))
    return found


def _by_direction(document: UpdateDocument) -> Markup:
    first, last = document["steps"][0]["by_direction"], result_step(document)["by_direction"]
    rows = [
        (
            name,
            str(before["readings"]),
            _percent(before["mean_abs_error_percent"]),
            _percent(last[name]["mean_abs_error_percent"]),
            _percent(last[name]["held_out_error_percent"]),
            f"{before['bias_percent']:+.1f} %",
            f"{last[name]['bias_percent']:+.1f} %",
        )
        for name, before in first.items()
    ]
    head = ("direction", "readings", "as given", "after", "after, left out", "bias as given", "bias after")
    remark = f"Bias: mean of {DEVIATION}, {MINUS_IS_SOFTER}."
    return table(head, [("", row) for row in rows], range(1, len(head))) + markup('<p class="muted">{}</p>', remark)


def _where(end: LawEntry) -> str:
    """At which strut length a stiffness of the law is meant."""
    return "at every length" if end["length_mm"] is None else f"at {end['length_mm']:.1f} mm"


def _fitted(document: UpdateDocument) -> Markup:
    last = result_step(document)
    rows = [
        ("strut law", _where(end), f"{end['stiffness']:.2f} N/um", f"sd {end['sd']:.2g} N/um")
        for end in last["strut_law_N_per_um"]
        if end["sd"] is not None
    ]
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):
                low, high = (_value(end) for end in value["interval"])
                rows.append((effect, key, f"{_value(value['value'])} {value['unit']}", f"{low} to {high}"))
            else:
                rows.append((effect, key, str(value), "chosen"))
    return table(("effect", "parameter", "value", "95 % interval, or sd"), [("", row) for row in rows], (2, 3))


def _support(document: UpdateDocument) -> Markup:
    rows = []
    for one in (*document["support"], *document["rejected"]):
        gain = one["held_out_gain_in_se"]
        rows.append(
            (
                one["effect"],
                "yes" if one["supported"] else "no",
                "-" if gain is None else f"{gain:+.1f} se",
                f"{number(one['likelihood_gain'], 1)} (chance: {number(one['threshold'], 1)})",
                "; ".join(one["reasons"]),
            )
        )
    head = ("effect", "supported", "fall at left-out points", "gain in twice the log likelihood", "what is against it")
    return table(head, [("", row) for row in rows], (2, 3))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} %"


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


WIDTH = 110
MACHINE_FILE = "machine.toml"


def text(document: UpdateDocument) -> str:
    """Ladder, errors by direction before and after, parameters, what was turned down."""
    lines = [
        f"data     {counted(document['readings'], 'reading')} of {', '.join(map(plain, document['data']))}, "
        f"machine {machine_text(document)}",
        fill(f"result   {document['verdict'].upper()}. {plain(document['text'])}", WIDTH, subsequent_indent=" " * 9),
        "",
        *_ladder(document),
        "",
        *_direction_lines(document),
    ]
    parameters = _parameters(document)
    if parameters:
        lines += ["", *parameters]
    if document["rejected"]:
        lines += ["", "tried and not added"]
        for one in document["rejected"]:
            lines.append(fill(f"  {one['effect']}: {'; '.join(one['reasons'])}", WIDTH, subsequent_indent=" " * 4))
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    return "\n".join(lines).rstrip()


def _ladder(document: UpdateDocument) -> list[str]:
    steps = document["steps"]
    width = max(len(step["name"]) for step in steps)
    found = [f"{'':<{width}}  error %  left out %  gain/SE"]
    for step in steps:
        gain = step.get("held_out_gain_in_se")
        found.append(
            f"{plain(step['name']):<{width}}  {step['mean_abs_error_percent']:>7.2f}  "
            f"{_figure(step['held_out_error_percent'], 10)}  {_figure(gain, 7, 1)}"
        )
    found.append(
        f"{'noise floor':<{width}}  {document['noise_floor_percent']:>7.2f}  ({plain(document['noise']['origin'])})"
    )
    return found


def result_step(document: UpdateDocument) -> StepEntry:
    """The model that comes out: the last step, the machine file as given where nothing is added."""
    return document["steps"][0 if document["verdict"] == "nothing added" else -1]


def _direction_lines(document: UpdateDocument) -> list[str]:
    first, last = document["steps"][0]["by_direction"], result_step(document)["by_direction"]
    found = ["direction  readings  as given %  after %  left out %"]
    for name, before in first.items():
        after = last[name]
        found.append(
            f"{name:<9}  {before['readings']:>8}  {before['mean_abs_error_percent']:>10.2f}  "
            f"{after['mean_abs_error_percent']:>7.2f}  {_figure(after['held_out_error_percent'], 10)}"
        )
    return found


def _parameters(document: UpdateDocument) -> list[str]:
    last = result_step(document)
    found = []
    if last["strut_law_N_per_um"][0]["sd"] is not None:
        ends = " and ".join(
            f"{end['stiffness']:.1f} +- {end['sd']:.1f} N/um {_where(end)}" for end in last["strut_law_N_per_um"]
        )
        found.append(f"strut law  {ends}")
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):  # what it acts on stands in the ladder
                low, high = (_plain_value(end) for end in value["interval"])
                found.append(f"{effect}  {key} = {_plain_value(value['value'])}   95 %: {low} to {high}")
    return found


def _plain_value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def _figure(value: float | None, width: int, digits: int = 2) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:>{width}.{digits}f}"


def names(plots: bool = True, *, machine: bool = True, figure3: bool = False) -> tuple[str, ...]:
    """Names of the files that `files` makes; `figure3`: those of the paper's Figure 3 too."""
    found = ["update.json", "residuals.csv"]
    found += [MACHINE_FILE] if machine else []
    found += ["figure3.csv"] if figure3 else []
    if plots:
        found += [*(["figure3.png"] if figure3 else []), "ladder.png", "before_after.png", "report.html"]
    return tuple(found)


def files(
    update: Update,
    document: UpdateDocument,
    *,
    machine: Machine | None = None,
    bars: BarCurve | None = None,
    plots: bool = True,
) -> dict[str, Content]:
    """`document` as JSON, one row a reading, and with `plots` pictures and page.

    `machine`: the updated one, as `machine.toml`; `bars`: the curve of the paper's Figure 3.
    """
    contents: dict[str, Content] = {
        "update.json": json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "residuals.csv": residuals_csv(update),
    }
    if machine is not None:
        contents[MACHINE_FILE] = machine_toml(machine, machine_heading(document))
    if bars is not None:
        contents["figure3.csv"] = bar_curve_csv(bars)
    return contents | (_pictures(document, update, bars) if plots else {})


def machine_heading(found: UpdateDocument) -> str:
    """The remark above the machine file that an update writes."""
    provenance = found["provenance"]
    return "\n".join(
        [
            fill(f"Machine {found['machine']}, updated. {found['text']}", 110),
            f"Command: {provenance['command']}",
            f"SHA-256 of the data: {provenance['data_sha256']}",
            "",
        ]
    )


def _pictures(found: UpdateDocument, update: Update, bars: BarCurve | None) -> dict[str, Content]:
    last = found["steps"][-1]
    called = f"with {' + '.join(last['effects'])}" if last["effects"] else last["name"]
    entry = {"effect": called, "held_out_error_percent": last["held_out_error_percent"]}
    drawn = before_after_png(
        {"verdict": found["verdict"], "baseline": found["strut_law_refitted"], "candidates": [entry], "best": called},
        update.data.of_tip, update.steps[0].residual, update.steps[-1].residual, names=("as given", called),
    )  # fmt: skip
    pictures: dict[str, bytes] = {}
    if bars is not None:
        percent = 100.0 * bars.error[:-1], 100.0 * bars.error_refitted[:-1]
        pictures["figure3.png"] = figure3_png(bars.bars[:-1], percent[0], refitted_percent=percent[1])
    pictures |= {
        "ladder.png": error_ladder_png(*ladder(found)),
        "before_after.png": drawn,
    }
    return {**pictures, "report.html": update_html(found, pictures)}


def ladder(found: UpdateDocument) -> tuple[Any, ...]:
    """What `error_ladder_png` takes."""
    turned_down = [{**one, "name": one["effect"]} for one in found["rejected"]]
    floor, question = found["noise_floor_percent"], "What does each step do to the error?"
    return [_rung(step) for step in found["steps"]], floor, question, turned_down


def _rung(step: StepEntry) -> dict[str, Any]:
    """A step with what its effect acts on below the effect's name."""
    choices = re.findall(r"\(([^)]*)\)", step["name"])
    return {**step, "name": re.sub(r" \([^)]*\)", "", step["name"]), "remark": ", ".join(choices)}


@drawn
def error_ladder_png(
    steps: Sequence[Mapping[str, Any]],
    noise_floor_percent: float | None = None,
    title: str = "How the error falls",
    turned_down: Sequence[Mapping[str, Any]] = (),
) -> Figure:
    """PNG: mean error from the first model to the last, in sample and at left-out points, with the noise floor.

    Parameters
    ----------
    steps
        Each with `name`, `mean_abs_error_percent`, `held_out_error_percent`; optionally `held_out_se_percent`, the
        standard error of the fall from the step before, and `remark`.
    noise_floor_percent
        Mean absolute error that scatter alone would leave: 0.80 times its standard deviation.
    title
        Heading.
    turned_down
        Further steps that were tried from the last one and not taken; keys as of `steps`.
    """
    taken = len(steps)
    steps = [*steps, *turned_down]
    with house_style():
        figure = new_figure(max(11.0, 2.4 + 1.9 * len(steps)), 5.2)
        width, height = figure.get_size_inches()
        figure.text(0.25 / width, 1.0 - 0.4 / height, plain(title), size=14, weight="bold")
        axes = figure.add_axes((0.85 / width, 0.95 / height, 1.0 - 1.15 / width, 1.0 - 1.75 / height))
        at = np.arange(len(steps))
        held, inside = (
            np.array(
                [figure_of(step, key) if figure_of(step, key) is not None else np.nan for step in steps], dtype=float
            )
            for key in ("held_out_error_percent", "mean_abs_error_percent")
        )
        _draw_steps(axes, held, inside, taken)
        spread = np.array([figure_of(step, "held_out_se_percent") or 0.0 for step in steps])
        if spread.any():
            axes.errorbar(at, held, yerr=spread, fmt="none", ecolor=BLUE, elinewidth=1.5, capsize=4, zorder=4)
        if noise_floor_percent is not None:
            axes.axhline(
                noise_floor_percent, color=SECOND_ORANGE, ls=":", lw=1.5,
                label=f"noise floor {percent(noise_floor_percent)}",
            )  # fmt: skip
        known = np.array([*held, *inside, noise_floor_percent or 0.0])
        top = float(np.nanmax(known)) if np.isfinite(known).any() else 1.0
        _name_values(axes, held, {"xytext": (9, 7), "color": BLUE})
        _name_values(axes, inside, {"xytext": (-9, -14), "color": MUTED, "size": 9, "ha": "right"})
        axes.set_ylim(0.0, 1.25 * top or 1.0)
        axes.set_xlim(-0.4, len(steps) - 0.3)
        axes.set_xticks(at, [_step_text(step) for step in steps], color=INK, size=9)
        axes.set_ylabel("mean |modelled - measured| / measured, %", size=9.5)
        axes.grid(visible=False, axis="x")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, ncol=3, loc="lower left", bbox_to_anchor=(-0.01, 1.0))
        return figure


def _draw_steps(axes: Axes, held: FloatArray, inside: FloatArray, taken: int) -> None:
    """Errors at left-out points and in sample: the first `taken` joined, those that were not taken apart."""
    at = np.arange(len(held))
    axes.plot(at[:taken], held[:taken], "o-", color=BLUE, lw=2.0, ms=9, label="at points left out", zorder=4)
    axes.plot(at[:taken], inside[:taken], "s--", color=MUTED, lw=1.3, ms=6, mfc="white", label="in sample", zorder=3)
    if taken < len(held):
        axes.axvspan(taken - 0.5, len(held) - 0.3, color=WITHIN, lw=0, zorder=0)
        axes.text(taken - 0.45, 0.97, "tried from there, not taken", color=MUTED, size=9, va="top",
                  transform=axes.get_xaxis_transform())  # fmt: skip
        axes.plot(at[taken:], held[taken:], "o", color=BLUE, ms=9, mfc="white", zorder=4)
        axes.plot(at[taken:], inside[taken:], "s", color=MUTED, ms=6, mfc="white", zorder=3)


def _name_values(axes: Axes, values: FloatArray, style: dict[str, Any]) -> None:
    """The figures beside the points."""
    for x, value in enumerate(values.tolist()):
        if np.isfinite(value):
            axes.annotate(percent(value), (x, value), textcoords="offset points", **style)


def _step_text(step: Mapping[str, Any]) -> str:
    lines = [shortened(plain(str(step.get("name") or "-")), 24)]
    if step.get("remark"):
        lines.append(shortened(plain(str(step["remark"])), 28))
    return "\n".join(lines)


@drawn
def figure3_png(
    bars_N_per_m: Sequence[float] | FloatArray,
    error_percent: Sequence[float] | FloatArray,
    printed_points: Sequence[tuple[float, float]] = (),
    refitted_percent: Sequence[float] | FloatArray = (),
) -> Figure:
    """PNG of the paper's Figure 3: mean error against the stiffness of the platform's bars.

    Parameters
    ----------
    bars_N_per_m
        (n,) stiffness of each bar.
    error_percent
        (n,) mean error of the model with the machine's own strut law.
    printed_points
        (bar stiffness N/m, error %) that the paper prints or draws.
    refitted_percent
        (n,) with the strut law that makes the error smallest for each platform, if known.
    """
    bars, errors = np.asarray(bars_N_per_m, dtype=float), np.asarray(error_percent, dtype=float)
    with house_style():
        figure = new_figure(11.0, 5.2)
        figure.text(0.03, 0.93, "How stiff must the platform be taken?", size=14, weight="bold")
        figure.text(0.03, 0.88, "Figure 3 of Clinton, Zhang and Wavering (1997), computed here", size=9.5, color=MUTED)
        axes = figure.add_axes((0.09, 0.13, 0.87, 0.68))
        axes.plot(bars, errors, color=BLUE, lw=2.0, label="with the machine file's strut law")
        if len(refitted_percent):
            axes.plot(
                bars, refitted_percent, color=MUTED, lw=1.5, ls="--", label="strut law refitted for each platform"
            )
        if len(printed_points):
            printed = np.asarray(printed_points, dtype=float)
            axes.plot(
                printed[:, 0], printed[:, 1], "o", ms=8, mfc="white", mec=SECOND_ORANGE, mew=2.0, label="the paper"
            )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
        axes.set_xlabel("stiffness of each platform bar, N/m")
        axes.set_ylabel("mean |modelled - measured| / measured, %")
        axes.legend(frameon=False)
        return figure
