"""Cases of `benchmarks.built`: a machine of springs or of elements, a small campaign, and what was made of it."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import toolpath_stiff as tps
from benchmarks.bars import Record
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.planning.result import plan_csv
from toolpath_stiff.rig import case as rig
from toolpath_stiff.rig.campaigns import DEFAULT_SETUP, Table, campaign
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.exercise import NUMBERS, TEXTS, csv_text, read_plan
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.fem_path import path_truth
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.units import n_per_mm_from_n_per_m

JUDGED = ("sound", "single", "pair", "outside")
GROUPS = (*JUDGED, "known", "draft")
BUILT = ("fem", "springs")
POSES = (12, 28)  # fewest and most of a campaign
PAIR_SIZES = (0.10, 0.05)  # rms change of ln k of the two
SERIES = {"joints", "struts", "one strut"}  # all in series along a strut: the tip cannot tell them apart
PLANNED = 6  # visits of a plan


@dataclass(frozen=True)
class Job:
    """One case; `hidden` are names of the rig, with commas, or `none`.

    Of the group `known` what is hidden need not be found: it is added by its name, to judge the bands alone. Of the
    group `draft` it lies outside the catalogue; what is read off half of a tilted campaign is put to the other half.
    """

    built: str
    group: str
    seed: int
    hidden: str


def make_jobs(first_seed: int, counts: Mapping[str, int], built: Sequence[str]) -> list[Job]:
    """So many cases of each group on each build, the kinds in turn; a case's seed is that of no other."""
    jobs = []
    for number, way in enumerate(built):
        named, _, outside = rig.hideable({*NUMBERS, *TEXTS}, fem=way == "fem")  # all columns of a tilted campaign
        rng = np.random.default_rng([first_seed, number])
        for place, group in enumerate(GROUPS):
            kinds = rng.permutation(outside if group in ("outside", "draft") else named).tolist()
            if group == "known":  # a fault of an instrument is none of the machine
                kinds = [kind for kind in kinds if "instrument" not in links_of(kind, way)]
            for k in range(counts[group]):
                pair = ",".join(rng.choice(named, size=2, replace=False))
                hidden = {"sound": "none", "pair": pair}.get(group, kinds[k % len(kinds)])
                hidden = "none" if group == "known" and k % 2 else hidden
                jobs.append(Job(way, group, first_seed + 100_000 * number + 10_000 * place + k, hidden))
    return jobs


def small_campaign(seed: int) -> Table:
    """12 to 28 poses of two tilted campaigns, X, Y, Z; some visited twice, one or two loads."""
    nominal, rng = load_nominal(), np.random.default_rng([seed, 77])
    one, other = (campaign("tilted", nominal, None, rng) for _ in range(2))
    other["point"], other["clamp"] = other["point"] + one["point"].max(), other["clamp"] + one["clamp"].max()
    table = {name: [*one[name], *other[name]] for name in one}
    points = rng.choice(np.unique(table["point"]), size=rng.integers(POSES[0], POSES[1] + 1), replace=False)
    twice = points[: int(rng.integers(2, len(points) + 1))]  # at least two, that the noise can be told
    kept = np.isin(table["point"], points) & ((np.array(table["repeat"]) == 1) | np.isin(table["point"], twice))
    if rng.random() < 0.5:
        kept &= np.array(table["force_N"]) > 1000.0
    return {
        name: [value for value, keep in zip(values, kept, strict=True) if keep]
        if isinstance(values[0], str) else np.array(values)[kept]
        for name, values in table.items()
    }  # fmt: skip


def diagnosed(job: Job, folder: Path) -> Record:
    """What is made of a case, beside the truth."""
    if job.group == "draft":
        return drafted(job, folder)
    plan = small_campaign(job.seed)
    size = PAIR_SIZES if job.group == "pair" else None
    case = rig.draw_case(job.seed, "campaign", job.hidden, plan=plan, size=size, built=job.built)
    file = folder / "measurements.csv"
    file.write_text(csv_text(case.rows))
    truths = [truth_of(effect, job.built) for effect in case.truth["effects"]]
    record: Record = {"truths": truths, "poses": len(np.unique(plan["point"])), "readings": len(plan["point"])}
    rows, rng = rig.rows_of(plan), np.random.default_rng(job.seed)
    path = case.truth.get("path") or path_truth(case.nominal, case.machine, rows, rng)
    if job.group == "known":
        names = [truth["names"][0] for truth in truths]
        return record | along_path(tps.update(file, add=names, strut_law=True, force=True), path)
    start = time.process_time()
    diagnosis = tps.diagnose(file)
    record["cpu"] = round(time.process_time() - start, 2)
    if diagnosis.verdict == "ambiguous" and job.group == "single":
        more = planned(diagnosis, file, case, np.random.default_rng([job.seed, 5]))
        again = tps.diagnose([file, *more])
        record["planned"] = answer_of(again) | along_path(updated(again, [file, *more], folder), path)
    if truths and not any("instrument" in truth["links"] for truth in truths):
        record["believed"] = along_path(updated(diagnosis, [file], folder, believe="machine"), path)["after"]
    return record | answer_of(diagnosis) | along_path(updated(diagnosis, [file], folder), path)


def drafted(job: Job, folder: Path) -> Record:
    """Effects that are drafted of every other clamping of a tilted campaign, and whether all readings name one of them.

    `same`: the other clampings are of the same machine. `gone`: of that machine without what the draft was read off.
    """
    case = rig.draw_case(job.seed, "tilted", job.hidden, built=job.built)
    sound = rig.draw_case(job.seed, "tilted", "none", built=job.built)  # the same poses, struts, joints and scatter
    old, file, draft_file = np.asarray(case.rows["clamp"]) % 2 == 0, folder / "readings.csv", folder / "missing.toml"
    file.write_text(csv_text({name: np.asarray(values)[old] for name, values in case.rows.items()}))
    draft = tps.draft_effect(file, file=draft_file)
    record: Record = {
        "truths": [truth_of(effect, job.built) for effect in case.truth["effects"]],
        "drafted": draft.effects,
    }
    if not draft.text:
        return record
    draft_file.write_text(draft.text)
    for what, rows in (("same", case.rows), ("gone", sound.rows)):
        mixed = {name: np.where(old, np.asarray(case.rows[name]), np.asarray(rows[name])) for name in case.rows}
        file.write_text(csv_text(mixed))
        said = tps.diagnose(file, tps.Machine.load("nist", effects=[draft_file])).to_dict()
        named = any(name in words for name in draft.effects for words in said["explanations"])
        record[what] = said["verdict"] == "identified" and named
    return record


def planned(diagnosis: tps.Diagnosis, file: Path, case: rig.DrawnCase, rng: np.random.Generator) -> list[Path]:
    """A plan of a few visits, measured on the same machine, as a file; none where nothing tells more."""
    plan = tps.plan(file, n=PLANNED, indicators=True, diagnosis=diagnosis)
    more = file.with_name("plan.csv")
    more.write_text(plan_csv(plan.rows))
    more.write_text(csv_text(case.again(read_plan(str(more), case.nominal), rng)))
    return [more]


def truth_of(effect: Mapping[str, Any], built: str) -> dict[str, Any]:
    """Names of the catalogue that are right, links that are, and size, of a hidden effect."""
    name = effect["effect"]
    right = list(effect["names"]) if built == "fem" else [name] if name in CATALOGUE else []
    links = set(effect.get("links", ())) or links_of(name, built)
    links |= SERIES if links & SERIES else set()
    return {"hidden": name, "names": right, "links": sorted(links), "size": effect["size"]}


def links_of(name: str, built: str) -> set[str]:
    """Links of a fault of elements, or the link of an effect of the catalogue."""
    return set(FAULTS[name].links) if built == "fem" else {links_of_effects()[name]}


@cache
def links_of_effects() -> dict[str, str]:
    """Effect of the catalogue -> its link."""
    return {effect["name"]: effect["link"] for effect in tps.effects().to_dict()["effects"]}


def answer_of(diagnosis: tps.Diagnosis) -> Record:
    """What is said: verdict, effects of each explanation, links of the portrait, rows left out."""
    said = diagnosis.to_dict()
    portrait = said.get("portrait") or {"links": []}
    return {
        "verdict": said["verdict"],
        "explanations": [words.split(" + ") for words in said["explanations"]],
        "entries": len(said["entries"]),
        "portrait": [entry["link"] for entry in portrait["links"]],
        "left_out": sum(bool(row.get("left_out")) for row in said.get("suspect_rows", ())),
    }


def along_path(update: tps.Update | None, path: Mapping[str, Any]) -> Record:
    """Mean error (%) along the path before and after an update, if there is one, and how often bands hold.

    Both at the poses that the updated machine reaches; `unreached`: how many it does not.
    """
    near = np.array(path["measured_near"])
    true = np.column_stack([path[f"{axis}_N_per_mm"] for axis in "xyz"])
    before = stiffness_along(tps.Machine.load("nist"), path)[0]
    if update is None or not update.accepted:
        error = _percent(before, true, near)
        return {"before": error, "after": error, "updated": ""}
    there, sd, lowest = stiffness_along(update.machine.under(setup=DEFAULT_SETUP), path)
    reached = np.isfinite(there).all(axis=1)
    near, true, before, there, sd = (values[reached] for values in (near, true, before, there, sd))
    held = {"unreached": int((~reached).sum())}
    if np.isfinite(sd).all():
        off = np.abs(true - there) / sd
        least, most = lowest.T
        true_lowest = true[near].min(axis=0)
        held |= {
            "band_near": float((off < 1.96)[near].mean()),
            "band_weakest": float(((least < true_lowest) & (true_lowest < most)).mean()),
            "band_beyond": float((off < 1.645)[~near].mean()) if not near.all() else None,
        }  # fmt: skip
    added = ", ".join(step["name"] for step in update.to_dict()["steps"])
    return {"before": _percent(before, true, near), "after": _percent(there, true, near), "updated": added, **held}


def _percent(model: FloatArray, true: FloatArray, rows: FloatArray) -> float:
    return round(float(100.0 * np.mean(np.abs(model / true - 1.0)[rows])), 3)


def updated(
    diagnosis: tps.Diagnosis, files: Sequence[Path], folder: Path, believe: str | None = None
) -> tps.Update | None:
    """The update that a verdict leads to: its first explanation, what `auto` finds, or a draft; None for none."""
    said = diagnosis.to_dict()
    try:
        if said["verdict"] == "unexplained":
            draft = tps.draft_effect(files, file=folder / "missing.toml")
            if not draft.text:
                return None
            (folder / "missing.toml").write_text(draft.text)
            with_draft = tps.Machine.load("nist", effects=[folder / "missing.toml"])
            return tps.update(files, with_draft, add=list(draft.effects), believe=believe)
        first = next((words for words in said["explanations"] if words != "none"), "")
        named = tps.update(files, add=first.split(" + "), believe=believe) if said["verdict"] != "adequate" else None
        return named if named is not None and named.accepted else tps.update(files, auto=True, believe=believe)
    except tps.InputError:
        return None


def stiffness_along(machine: tps.Machine, path: Mapping[str, Any]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(p, 3) N/mm along X, Y, Z at the poses of a path, and standard deviations there, nan where none is stated.

    Stiffness is nan where the machine does not reach. (3, 2): 95 % intervals of the lowest along each axis amid the
    measured poses.
    """
    poses = np.column_stack([path[name] for name in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")])
    words = [" ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABC", pose, strict=True)) for pose in poses]
    blocks = ["G21 G90 G94", f"G0 {words[0]}", *(f"G1 {word} F1000" for word in words), "M30"]
    program = tps.Program.from_text("\n".join(blocks), name="path.nc")
    columns: list[tuple[FloatArray, FloatArray]] = []
    lowest = np.full((3, 2), np.nan)
    for k, axis in enumerate("xyz"):
        analysis = tps.analyze(program, machine, origin_mm_deg=(0,) * 6, step_mm=1000, load=axis, partial=True)
        line = np.asarray(analysis.to_frame()["line"])
        last = np.searchsorted(line, np.arange(len(poses)) + 3, side="right") - 1
        stiffness = np.asarray(analysis.to_frame()["stiffness_N_per_mm"], dtype=float)
        deviation = analysis.deviation_N_per_mm
        columns.append((stiffness[last], np.full(len(poses), np.nan) if deviation is None else deviation[last]))
        amid = np.isin(np.arange(len(stiffness)), last[np.array(path["measured_near"])]) & np.isfinite(stiffness)
        if (band := analysis.parameter_band) is not None:
            lowest[k] = n_per_mm_from_n_per_m(band.of_lowest(analysis.at.stiffness, amid * 1.0)[1])
    there, sd = (np.column_stack(part) for part in zip(*columns, strict=True))
    return there, sd, lowest
