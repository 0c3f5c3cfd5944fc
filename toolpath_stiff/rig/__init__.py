"""Blind simulator of a measuring campaign on a machine that hides something; here a blind exercise as a folder.

It judges the model and therefore shares no code with it but units, errors and files: its own machine reader, its own
kinematics, its own mechanics (assembled elements, displacement method).

>>> rows, truth = make_case(seed=7, layout="paper", hidden="weak_strut")
>>> truth["hidden"], len(rows["stiffness_N_per_mm"])
(['weak_strut'], 42)

An exercise is measurements.csv, machine.toml and sealed.bin; it is measured again, and its seal is opened. The sealed
truth is opaque to a look into the file, and tampering is noticed. It is no cryptography: the key stands below, so
whoever wants to cheat can; the seal keeps an honest user from reading the answer by accident. The truth is written as
JSON, compressed, padded to one length (so that the size tells nothing), scrambled with a SHA-256 key stream and
preceded by a keyed digest.

Slips of whoever writes measurements down: a mistyped row, two readings exchanged, a noise stated wrongly.

The machine is measured as it is; only what stands in the table changes. Every function returns a new table and the
truth of what it did, so that a search for such slips can be judged.

A slip of a pose or of a sign is made where a form has it once: in one row, or in all rows of a clamping.
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import hmac
import io
import json
import math
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import FileError, InputError, InputErrors
from toolpath_stiff.files import Content, read_bytes, read_text, write_atomically
from toolpath_stiff.results_folder import Rules, check_folder, write_folder
from toolpath_stiff.rig.case import (
    AXES,
    DEFAULT_SETUP,
    POSE,
    Case,
    Table,
    again,
    clamp_of,
    draw_case,
    effects_of_layout,
    make_case,
    rows_of,
)
from toolpath_stiff.rig.effects import CATALOGUE, scale_of
from toolpath_stiff.rig.hidden import LOOP_PATTERN, LOOP_WORDS, OUTSIDE, HiddenMachine, Nuisances, Oddity, readings
from toolpath_stiff.rig.structure import Nominal, load_nominal, parse_nominal, reachable
from toolpath_stiff.rig.unknowns import UNKNOWNS, Unknown
from toolpath_stiff.units import MM_PER_INCH, m_from_mm, rad_from_deg

__all__ = [
    "CATALOGUE",
    "OUTSIDE",
    "UNKNOWNS",
    "Case",
    "Nuisances",
    "csv_text",
    "draw_case",
    "effects_of_layout",
    "make_case",
    "measure_again",
    "measured_again",
    "new_exercise",
    "reveal",
]

MAGIC = b"tps-rig-sealed-1\n"
KEY = b"toolpath_stiff.rig: not a secret, only a blindfold"
DIGEST = hashlib.sha256().digest_size
BLOCK = 8192  # bytes; several times what one case needs

# Column -> lowest and highest value that makes sense, and the value of an empty cell (None: a number is needed).
NUMBERS: dict[str, tuple[float, float, float | None]] = {
    **dict.fromkeys(POSE[:3], (-1e5, 1e5, None)),
    **dict.fromkeys(POSE[3:], (-360.0, 360.0, 0.0)),
    **dict.fromkeys(("dx", "dy", "dz"), (-1e3, 1e3, None)),
    "force_N": (1e-3, 1e6, defaults.FORCE),
    "time_min": (0.0, 1e5, 0.0),
    "tool_extension_mm": (-1e4, 1e4, 0.0),
    "temperature_C": (-50.0, 100.0, 20.0),
    "length_mm": (1.0, 1e5, np.nan),
}
WHOLE = ("clamp",)
LABELS = ("repeat", "point")  # any text
WORDS = ("setup", "loop")
RESULTS = ("stiffness_N_per_mm", "sd_N_per_mm", "displacement_um")

# Claims, verdicts of a diagnosis among them: that nothing is hidden, and that something is which the catalogue lacks.
# Of a `described` effect the form was drawn from the readings: it is none of the catalogue.
SOUND, OTHER = ("none", "adequate"), ("outside", "unexplained", "described")
MEASUREMENTS, MACHINE, SEALED = FILES = "measurements.csv", "machine.toml", "sealed.bin"
NO_OTHER = Rules(fresh=True)

# Kind -> what was done.
SLIPS = {
    "directions_exchanged": "two readings of one clamping and load stand under each other's direction",
    "sign_of_angle": "an angle with the wrong sign",
    "sign_of_coordinate": "x or y with the wrong sign",
    "lbf_per_in": "a stiffness in lbf/in",
    "N_per_um": "a stiffness in N/um",
    "pose_10_mm": "a coordinate off by 10 mm",
    "pose_1_deg": "an angle off by 1 degree",
    "pose_5_deg": "an angle off by 5 degrees",
}
N_PER_LBF = 4.4482216152605  # exact: 0.45359237 kg (international pound, 1959) times 9.80665 m/s2 (CGPM 1901)
WRITTEN_PER_N_PER_MM = {"lbf_per_in": MM_PER_INCH / N_PER_LBF, "N_per_um": 1e-3}
WRONG_BY = {"pose_10_mm": 10.0, "pose_1_deg": 1.0, "pose_5_deg": 5.0}  # mm or degrees
SMALLEST_ANGLE, SMALLEST_COORDINATE = 3.0, 30.0  # degrees, mm: a wrong sign of less is hardly a mistake (assumed)
TRIES = 200  # draws until the written pose is one that the machine can reach

# Whitened length of a slip that is found with 80 % power at 5 % among all slips of all rows of a tilted campaign, some
# 6000: z(1 - 0.05/6000/2) + z(0.8) = 4.46 + 0.84 (normal quantiles, Bonferroni).
VISIBLE = 5.3


def seal(case: Case, seed: int, layout: str) -> bytes:
    """Content of `sealed.bin`; the same case gives the same bytes."""
    machine = {
        field.name: value.tolist() if isinstance(value := getattr(case.machine, field.name), np.ndarray) else value
        for field in dataclasses.fields(case.machine)
    }
    if case.machine.oddity is not None:
        machine["oddity"] = dataclasses.asdict(case.machine.oddity)
    if case.machine.unknown is not None:
        machine["unknown"] = dataclasses.asdict(case.machine.unknown)
    content = {
        "seed": seed,
        "layout": layout,
        "truth": case.truth,
        "machine": machine,
        "nuisances": dataclasses.asdict(case.nuisances),
        "nominal": {"name": case.nominal.name, "text": case.nominal.text},
        "columns": list(case.rows),
        "clamps": int(max(case.rows.get("clamp", [0]))),
    }
    packed = zlib.compress(json.dumps(content, sort_keys=True).encode(), 9)
    length = len(packed).to_bytes(4, "big")
    body = (length + packed).ljust(-(-(len(packed) + 4) // BLOCK) * BLOCK, b"\0")
    digest = hmac.digest(KEY, body, "sha256")
    return MAGIC + digest + _scrambled(body, digest)


def unseal(file: str | Path) -> tuple[Case, dict[str, Any]]:
    """The case (without its rows) and what else was sealed. Raises `InputError` if the file was changed."""
    try:
        content = read_bytes(file, "the sealed truth")
    except FileError as error:
        raise InputError(error.found, hint="give the folder that `tps rig new` wrote") from None
    digest = content[len(MAGIC) : len(MAGIC) + DIGEST]
    body = _scrambled(content[len(MAGIC) + DIGEST :], digest)
    if not content.startswith(MAGIC) or not hmac.compare_digest(digest, hmac.digest(KEY, body, "sha256")):
        raise InputError(
            "the seal is broken: the file was changed or is no sealed truth",
            hint="make the exercise anew with `tps rig new`",
            file=str(file),
        )
    sealed: dict[str, Any] = json.loads(zlib.decompress(body[4 : 4 + int.from_bytes(body[:4], "big")]))
    machine: dict[str, Any] = {k: np.array(v) if isinstance(v, list) else v for k, v in sealed["machine"].items()}
    machine["spindle"] = tuple(sealed["machine"]["spindle"])
    if sealed["machine"]["oddity"] is not None:
        machine["oddity"] = Oddity(**sealed["machine"]["oddity"])
    if sealed["machine"].get("unknown") is not None:
        machine["unknown"] = Unknown(**sealed["machine"]["unknown"])
    nominal = parse_nominal(sealed["nominal"]["text"], sealed["nominal"]["name"])
    case = Case({}, sealed["truth"], nominal, HiddenMachine(**machine), Nuisances(**sealed["nuisances"]))
    return case, sealed


def _scrambled(body: bytes, nonce: bytes) -> bytes:
    """The body, every byte exclusive-or with a key stream; its own inverse."""
    count = -(-len(body) // DIGEST)
    stream = b"".join(hashlib.sha256(KEY + nonce + i.to_bytes(4, "big")).digest() for i in range(count))
    return bytes(a ^ b for a, b in zip(body, stream, strict=False))


def score(hidden: list[str], claim: list[str]) -> str:
    """`right`, `partly`, `wrong` or `correctly none`.

    Nothing hidden is claimed by one of `SOUND`, something outside the catalogue by one of `OTHER` or by its own name.
    """
    claimed = set(claim) - set(SOUND)
    truth = set(hidden)
    if claimed & set(OTHER):
        claimed = (claimed - set(OTHER)) | ((truth & {*OUTSIDE, *UNKNOWNS}) or {"outside"})
    if not truth:
        return "wrong" if claimed else "correctly none"
    if claimed == truth:
        return "right"
    return "partly" if claimed & truth else "wrong"


def csv_text(table: Mapping[str, Any]) -> str:
    """The table as CSV; numbers as short as they are exact to ten digits."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table)
    for row in zip(*table.values(), strict=True):
        writer.writerow([value if isinstance(value, str) else f"{value + 0.0:.10g}" for value in row])
    return stream.getvalue()


def read_plan(file: str, nominal: Nominal) -> Table:
    """Table of a plan; stiffness and its sd may be there, empty or not, and are left out.

    Raises
    ------
    InputError, InputErrors
        Not a table of poses; or every bad cell and unreachable pose, named.
    """
    lines = _rows(read_text(file, "the plan"), file)
    if len(lines) < 2:
        raise InputError("no poses", expected="a heading (x_mm,y_mm,z_mm,direction ...) and rows", file=file)
    (first, heading), body = lines[0], lines[1:]
    heading = [name.strip() for name in heading]
    _check_heading(heading, file, first)
    errors: list[InputError] = []
    table: Table = {}
    for column, name in enumerate(heading):
        if name in RESULTS:
            continue
        values = []
        for line, row in body:
            cell = row[column].strip() if column < len(row) else ""
            try:
                values.append(_value(name, cell))
            except ValueError as error:
                errors.append(InputError(f"{name} {cell!r}", expected=str(error), file=file, line=line))
        table[name] = values if name in (*LABELS, *WORDS, "direction") else np.array(values)
    if errors:
        raise InputErrors(errors)
    _check_rows(table, [line for line, _ in body], nominal, file)
    return table


def _rows(text: str, file: str) -> list[tuple[int, list[str]]]:
    """Line and cells of every row that is not empty, whatever the line ends are."""
    reader = csv.reader(io.StringIO(text, newline=None))
    try:
        return [(reader.line_num, row) for row in reader if any(row)]
    except csv.Error as error:  # a quote that never ends, a cell beyond 131,072 characters
        raise InputError(f"not a CSV file: {error}", file=file, line=reader.line_num) from None


def _check_heading(heading: list[str], file: str, line: int) -> None:
    known = (*NUMBERS, *WHOLE, *LABELS, *WORDS, *RESULTS, "direction")
    for name in heading:
        if name not in known or heading.count(name) > 1:
            wrong = "unknown column" if name not in known else "column given twice:"
            raise InputError(f"{wrong} {name!r}", expected=", ".join(known), file=file, line=line)
    vectors = [name for name in ("dx", "dy", "dz") if name in heading]
    if ("direction" in heading) == bool(vectors) or len(vectors) not in (0, 3):
        raise InputError("directions unclear", expected="either direction or dx,dy,dz", file=file, line=line)
    for name in POSE[:3]:
        if name not in heading:
            raise InputError(f"column {name} is missing", expected="x_mm,y_mm,z_mm", file=file, line=line)


def _value(name: str, cell: str) -> float | int | str:
    """The value of a cell; ValueError says what was expected."""
    if name == "direction":
        if cell not in AXES:
            raise ValueError("X, Y or Z")
        return cell
    if name == "loop":
        if not LOOP_PATTERN.fullmatch(cell):
            raise ValueError(LOOP_WORDS)
        return cell
    if name in LABELS:
        return cell
    if name == "setup":
        return cell or DEFAULT_SETUP
    if name in WHOLE:
        if not re.fullmatch("[0-9]{1,9}", cell):
            raise ValueError("a whole number")
        return int(cell)
    low, high, default = NUMBERS[name]
    if not cell and default is not None:
        return default
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise ValueError(f"a number from {low:g} to {high:g}")
    return value


def _check_rows(table: Table, lines: list[int], nominal: Nominal, file: str) -> None:
    """Directions that are none and poses that the machine cannot take."""
    count = len(lines)
    poses = np.column_stack([table.get(name, np.zeros(count)) for name in POSE])
    extension = m_from_mm(np.asarray(table.get("tool_extension_mm", np.zeros(count))))
    reached = reachable(nominal, m_from_mm(poses[:, :3]), rad_from_deg(poses[:, 3:]), extension)
    errors = [
        InputError(f"machine {nominal.name} cannot reach this pose", file=file, line=line)
        for line, good in zip(lines, reached, strict=True)
        if not good
    ]
    if "dx" in table:
        length = np.linalg.norm([table[name] for name in ("dx", "dy", "dz")], axis=0)
        errors += [
            InputError("a direction of no length", expected="dx, dy, dz not all 0", file=file, line=line)
            for line, size in zip(lines, length, strict=True)
            if size < 1e-9
        ]
    if errors:
        raise InputErrors(errors)


def new_exercise(
    folder: str | Path,
    seed: int,
    layout: str = "tilted",
    hidden: str | None = None,
    noise: float = 0.02,
    machine: str = defaults.MACHINE,
    plan_file: str | None = None,
    rules: Rules = NO_OTHER,
) -> int:
    """Write a blind exercise; returns the number of rows. Raises `InputError`; then nothing is written.

    `rules`: what must not be replaced. An exercise in the folder is not, by default: its sealed truth would be lost.
    """
    check_folder(folder, FILES, rules)
    nominal = load_nominal(machine)
    plan = None if plan_file is None else read_plan(plan_file, nominal)
    case = draw_case(seed, layout, hidden, noise, nominal, plan)
    contents: dict[str, Content] = {
        MACHINE: nominal.text,
        MEASUREMENTS: csv_text(case.rows),
        SEALED: seal(case, seed, layout),
    }
    write_folder(folder, contents, command="rig new", rules=rules)
    return len(case.rows["x_mm"])


def measure_again(folder: str | Path, plan_file: str, out: str | Path, visit: int = 1) -> int:
    """Write what `measured_again` measures to a file; returns the number of rows."""
    text, count = measured_again(folder, plan_file, visit)
    write_atomically(out, text)
    return count


def measured_again(folder: str | Path, plan_file: str, visit: int = 1) -> tuple[str, int]:
    """Measure the hidden machine of an exercise at a plan: the measurement file as text, and the number of rows.

    New clamps and new noise, which depend on the plan's bytes and on `visit` alone. Clamps are numbered on from a
    number that no other plan is likely to get, so that files can be read together.
    """
    if visit < 0:
        raise InputError(f"visit {visit}", expected="0 or more")
    case, sealed = unseal(Path(folder) / SEALED)
    plan = read_plan(plan_file, case.nominal)
    digest = hashlib.sha256(read_bytes(plan_file, "the plan")).digest()
    rng = np.random.default_rng([sealed["seed"], visit, int.from_bytes(digest[:8], "big")])
    if "clamp" in plan or "clamp" in sealed["columns"]:
        first = sealed["clamps"] + 1000 * int(rng.integers(1, 10**4))
        plan["clamp"] = first + (plan["clamp"] if "clamp" in plan else clamp_of(plan) + 1)
    stated_sd = "sd_N_per_mm" in sealed["columns"]
    measured = again(case.nominal, case.machine, case.nuisances, plan, rng, stated_sd)
    return csv_text(measured), len(plan["x_mm"])


def reveal(folder: str | Path, claim: str) -> dict[str, Any]:
    """What was hidden, and how the claim scores: `verdict`, `claim`, `hidden`, `kind`, `effects`, `seed`, `layout`."""
    claims = [name.strip() for name in claim.split(",") if name.strip()]
    known = (*SOUND, *OTHER, *CATALOGUE, *OUTSIDE, *UNKNOWNS)
    for name in claims:
        if name not in known:
            raise InputError(f"a claim {name!r}", expected=f"one or several of {', '.join(known)}")
    if not claims or (len(claims) > 1 and set(SOUND) & set(claims)):
        raise InputError(f"a claim {claim!r}", expected="names of effects, or none alone")
    case, sealed = unseal(Path(folder) / SEALED)
    return {
        "verdict": score(case.truth["hidden"], claims),
        "claim": claims,
        **case.truth,
        "seed": sealed["seed"],
        "layout": sealed["layout"],
    }


def with_slip(
    table: Mapping[str, Any],
    nominal: Nominal,
    rng: Generator,
    kind: str | None = None,
    nuisances: Nuisances | None = None,
) -> tuple[Table, dict[str, Any]]:
    """A measured table with one slip in it.

    Parameters
    ----------
    table
        A table with `stiffness_N_per_mm`.
    nominal
        To keep poses reachable, and for the size of the slip.
    kind
        One of `SLIPS`; None: drawn.
    nuisances
        For the size; the standard ones if not given.

    Returns
    -------
    table
        With the slip; a copy.
    truth
        `kind`; `rows` (numbered from 1) that are wrong; `columns`; `written` and `meant`, column -> what stands in and
        what belongs into each of these rows; `detectability`: whitened length of what the slip does to the residuals of
        the nominal machine, as of the effects. `VISIBLE` and more can be found.

    Raises
    ------
    InputError
        An unknown kind, or a table in which it cannot be made.
    """
    kind = str(rng.choice(list(SLIPS))) if kind is None else kind
    if kind not in SLIPS:
        raise InputError(f"no slip called {kind!r}", expected=", ".join(SLIPS))
    wrong = {name: np.array(values, dtype=object) for name, values in table.items()}
    if kind == "directions_exchanged":
        rows = _exchange(wrong, rng)
    elif kind in WRITTEN_PER_N_PER_MM:
        rows = np.array([int(rng.integers(len(wrong["x_mm"])))])
        written = wrong["stiffness_N_per_mm"][rows].astype(float) * WRITTEN_PER_N_PER_MM[kind]
        wrong["stiffness_N_per_mm"][rows] = np.round(written, 3)
    else:
        rows = _mistype(wrong, nominal, kind, rng)
    changed = [name for name in wrong if (wrong[name] != np.array(table[name], dtype=object)).any()]
    slipped: Table = {
        name: values.tolist() if isinstance(table[name], list) else values.astype(np.asarray(table[name]).dtype)
        for name, values in wrong.items()
    }
    truth = {
        "kind": kind,
        "rows": [int(row) + 1 for row in rows],
        "columns": changed,
        "written": {name: [slipped[name][row] for row in rows] for name in changed},
        "meant": {name: [table[name][row] for row in rows] for name in changed},
        "detectability": _length(table, slipped, nominal, Nuisances() if nuisances is None else nuisances),
    }
    return slipped, _plain(truth)


def slipped_case(case: Case, seed: int, kind: str | None = None, count: int = 1) -> tuple[Table, list[dict[str, Any]]]:
    """The rows of a case with `count` slips in different rows, and their truths."""
    rng = np.random.default_rng([seed, 5])  # beyond the streams of `draw_case`
    table = case.rows
    truths: list[dict[str, Any]] = []
    taken: set[int] = set()
    for _ in range(TRIES):
        if len(truths) == count:
            return table, truths
        trial, truth = with_slip(table, case.nominal, rng, kind, case.nuisances)
        if taken.isdisjoint(truth["rows"]):
            table = trial
            taken.update(truth["rows"])
            truths.append(truth)
    raise InputError(f"{count} slips of kind {kind or 'any'}", expected="fewer: the table has no room for them")


def with_stated_noise(
    table: Mapping[str, Any], nuisances: Nuisances, factor: float = 1.0
) -> tuple[Table, dict[str, float]]:
    """A table that states `sd_N_per_mm`, `factor` times as large as one reading's scatter is.

    The truth: `true_percent` and `stated_percent`, repeat noise and clamping together.
    """
    true = float(np.hypot(nuisances.repeat, nuisances.clamping))
    stated: Table = {}
    for name, values in table.items():
        if name != "sd_N_per_mm":
            stated[name] = values
        if name == "stiffness_N_per_mm":
            stated["sd_N_per_mm"] = np.round(np.asarray(values) * true * factor, 1)
    return stated, {"true_percent": 100.0 * true, "stated_percent": 100.0 * true * factor}


def _exchange(wrong: dict[str, Any], rng: Generator) -> IntArray:
    """Two rows of one clamping and one load get each other's stiffness."""
    clamps = clamp_of(wrong)
    loads = wrong.get("force_N", np.full(len(clamps), defaults.FORCE))
    for _ in range(TRIES):
        first = int(rng.integers(len(clamps)))
        others = np.flatnonzero(
            (clamps == clamps[first]) & (loads == loads[first]) & (wrong["direction"] != wrong["direction"][first])
        )
        if len(others):
            rows = np.array([first, int(rng.choice(others))])
            wrong["stiffness_N_per_mm"][rows] = wrong["stiffness_N_per_mm"][rows[::-1]]
            return np.sort(rows)
    raise InputError("no two directions of one clamping and load", expected="a campaign with several")


def _mistype(wrong: dict[str, Any], nominal: Nominal, kind: str, rng: Generator) -> IntArray:
    """A coordinate or an angle of one row, or of all rows of a clamping, is written wrongly."""
    names = [name for name in POSE if name in wrong]
    clamps = clamp_of(wrong)
    for _ in range(TRIES):
        row = int(rng.integers(len(clamps)))
        rows = np.flatnonzero(clamps == clamps[row]) if rng.random() < 0.5 else np.array([row])
        angle = kind in ("sign_of_angle", "pose_1_deg", "pose_5_deg")
        group = names[3:5] if kind == "sign_of_angle" else names[3:] if angle else names[:2]
        group = names[:3] if kind == "pose_10_mm" else group
        name = str(rng.choice(group))
        before = float(wrong[name][row])
        if kind.startswith("sign"):
            if abs(before) < (SMALLEST_ANGLE if angle else SMALLEST_COORDINATE):
                continue
            after = -before
        else:
            after = round(before + float(rng.choice([-1.0, 1.0])) * WRONG_BY[kind], 3)
        trial = dict(wrong) | {name: wrong[name].copy()}
        trial[name][rows] = after
        if _reached(trial, nominal, rows):
            wrong[name] = trial[name]
            return rows
    raise InputError(f"no row for the slip {kind}", expected="poses off the axis, or tilted, that stay reachable")


def _reached(table: Mapping[str, Any], nominal: Nominal, rows: IntArray) -> bool:
    one = rows_of({name: np.asarray(values)[rows] for name, values in table.items()})
    return bool(reachable(nominal, one.position, one.angles, one.extension).all())


def _length(table: Mapping[str, Any], slipped: Mapping[str, Any], nominal: Nominal, nuisances: Nuisances) -> float:
    """Whitened length of the change of ln measured - ln modelled."""
    modelled = [np.log(readings(nominal, HiddenMachine(), rows_of(one))) for one in (table, slipped)]
    measured = [np.log(np.asarray(one["stiffness_N_per_mm"], dtype=float)) for one in (table, slipped)]
    change: FloatArray = (measured[1] - measured[0]) - (modelled[1] - modelled[0])
    return scale_of(nominal, rows_of(table), clamp_of(table), nuisances).covariance.length(change)


def _plain(truth: dict[str, Any]) -> dict[str, Any]:
    """Python's own numbers, for JSON."""
    for key in ("written", "meant"):
        truth[key] = {
            name: [value.item() if isinstance(value, np.generic) else value for value in values]
            for name, values in truth[key].items()
        }
    return truth
