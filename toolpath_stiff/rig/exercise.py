"""A blind exercise as a folder: measurements.csv, machine.toml and sealed.bin; measuring again; opening the seal.

The sealed truth is opaque to a look into the file, and a change is noticed. It is no cryptography: whoever wants to
cheat can; the seal keeps an honest user from reading the answer by accident. The truth is written as JSON, compressed,
padded to one length with bytes that look the same (so that the size tells nothing) and preceded by a digest.
"""

import csv
import hashlib
import io
import json
import re
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff import column_files, defaults
from toolpath_stiff.documents import Document, to_dict
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.files import Content, read_bytes, read_text
from toolpath_stiff.results_folder import Rules, write_folder
from toolpath_stiff.rig.campaigns import DEFAULT_SETUP, POSE, Table
from toolpath_stiff.rig.case import DrawnCase, clamp_of, rows_of
from toolpath_stiff.rig.effects import BEYOND, HIDEABLE
from toolpath_stiff.rig.fem import FemMachine
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances
from toolpath_stiff.rig.kinematics import reachable
from toolpath_stiff.rig.loops import LOOP_PATTERN, LOOP_WORDS
from toolpath_stiff.rig.nominal import Nominal, parse_nominal
from toolpath_stiff.rig.robot import robot_case
from toolpath_stiff.rig.unknown import Unknown

MAGIC = b"tps-rig-sealed-2\n"
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
TEXTS = {  # column -> what matches, in words as well
    "direction": ("[XYZ]", "X, Y or Z"),
    "loop": (LOOP_PATTERN, LOOP_WORDS),
    "clamp": ("[0-9]{1,9}", "a whole number"),
    **dict.fromkeys(("repeat", "point", "setup"), ("(?s).*", "any text")),
}
RESULTS = ("stiffness_N_per_mm", "sd_N_per_mm", "displacement_um")
# Claims, including verdicts of a diagnosis: nothing is hidden, or something that the catalogue lacks.
# `described`: the effect's form was read off the readings, so it is not one of the catalogue.
SOUND, OTHER = ("none", "adequate"), ("outside", "unexplained", "described")
MEASUREMENTS, MACHINE, SEALED = FILES = "measurements.csv", "machine.toml", "sealed.bin"
NO_OTHER = Rules(fresh=True)


def seal(case: DrawnCase) -> bytes:
    """Content of `sealed.bin`; the same case gives the same bytes."""
    content = {
        "seed": case.seed,
        "layout": case.layout,
        "truth": case.truth,
        "machine": to_dict(case.machine),
        "nuisances": to_dict(case.nuisances),
        "nominal": {"name": case.nominal.name, "text": case.nominal.text},
        "columns": list(case.rows),
        "clamps": int(max(case.rows.get("clamp", [0]))),
    }
    if isinstance(case.machine, FemMachine):
        content["built"] = "fem"
    return sealed_bytes(content)


def sealed_bytes(content: Document) -> bytes:
    """Content of `sealed.bin` for a document."""
    packed = zlib.compress(json.dumps(content, sort_keys=True).encode(), 9)
    body = packed + hashlib.shake_256(packed).digest(-len(packed) % BLOCK)
    return MAGIC + hashlib.sha256(body).digest() + body


def opened(file: str | Path) -> Document:
    """Document that was sealed. Raises `InputError` if the file was changed."""
    content = read_bytes(file, "the sealed truth")
    digest, body = content[len(MAGIC) : len(MAGIC) + DIGEST], content[len(MAGIC) + DIGEST :]
    if not content.startswith(MAGIC) or hashlib.sha256(body).digest() != digest:
        raise InputError("the seal is broken: the file was changed or is no sealed truth", file=str(file))
    sealed: Document = json.loads(zlib.decompressobj().decompress(body))
    return sealed


def unseal(file: str | Path) -> tuple[DrawnCase, Document]:
    """The case (without its rows) and the rest of the sealed document. Raises `InputError` if the file was changed."""
    sealed = opened(file)
    if sealed.get("built") == "serial":
        raise InputError("a robot is pulled once", hint="make another exercise, with another --seed", file=str(file))
    machine: Table = {
        name: np.array(value) if isinstance(value, list) else value for name, value in sealed["machine"].items()
    }
    machine["unknown"] = machine["unknown"] and Unknown(**machine["unknown"])
    nominal = parse_nominal(sealed["nominal"]["text"], sealed["nominal"]["name"])
    true = (FemMachine if sealed.get("built") == "fem" else HiddenMachine)(**machine)
    return DrawnCase({}, sealed["truth"], nominal, true, Nuisances(**sealed["nuisances"])), sealed


def score(hidden: list[str], claim: list[str]) -> str:
    """`right`, `partly`, `wrong` or `correctly none`.

    Nothing hidden is claimed by one of `SOUND`, something outside the catalogue by one of `OTHER` or by its own name.
    """
    claimed, truth = set(claim) - set(SOUND), set(hidden)
    if claimed & set(OTHER):
        claimed = (claimed - set(OTHER)) | ((truth & BEYOND) or {"outside"})
    if claimed == truth:
        return "right" if truth else "correctly none"
    return "partly" if claimed & truth else "wrong"


def csv_text(table: Table) -> str:
    """The table as CSV, each number in the shortest form that is exact to ten digits."""
    columns = [[v if isinstance(v, str) else f"{v + 0.0:.10g}" for v in values] for values in table.values()]
    return column_files.csv_text(table, zip(*columns, strict=True))


def read_plan(file: str, nominal: Nominal) -> Table:
    """Table of a plan; columns of stiffness and its sd may be there, empty or not, and are dropped.

    Raises
    ------
    InputError, InputErrors
        Not a table of poses; or every bad cell and unreachable pose, named.
    """
    reader = csv.DictReader(io.StringIO(read_text(file, "the plan"), newline=None), restval="")  # whatever ends lines
    try:
        rows_read = [(reader.line_num, row) for row in reader if any(row.values())]
    except csv.Error as error:  # a quote that never ends, a cell beyond 131,072 characters
        raise InputError(f"not a CSV file: {error}", file=file, line=reader.reader.line_num) from None
    if not rows_read:
        raise InputError("no poses", expected="a heading (x_mm,y_mm,z_mm,direction ...) and rows", file=file)
    _check_heading(list(reader.fieldnames or ()), file)
    errors: list[InputError] = []
    columns: dict[str, list[Any]] = {name: [] for name in reader.fieldnames or () if name not in RESULTS}
    for line, row in rows_read:
        for name, values in columns.items():
            try:
                values.append(_value(name, row[name].strip()))
            except ValueError as error:
                errors.append(InputError(f"{name} {row[name]!r}", expected=str(error), file=file, line=line))
    table: Table = {
        name: np.array(values) if name == "clamp" or name in NUMBERS else values for name, values in columns.items()
    }
    if not errors:
        rows = rows_of(table)
        within = reachable(nominal, rows.position, rows.angles, rows.extension)
        faults = {
            f"machine {nominal.name} cannot reach this pose": ~within,
            "a direction of no length": ~np.isfinite(rows.direction).all(axis=1),
        }
        for fault, bad in faults.items():
            errors += [InputError(fault, file=file, line=rows_read[k][0]) for k in np.flatnonzero(bad)]
    if errors:
        raise InputErrors(errors)
    return table


def _check_heading(heading: Sequence[str], file: str) -> None:
    known = (*NUMBERS, *TEXTS, *RESULTS)
    faults = [f"unknown column {name!r}" for name in heading if name not in known]
    faults += [f"column {name} stands twice" for name in heading if heading.count(name) > 1]
    faults += [f"column {name} is missing" for name in POSE[:3] if name not in heading]
    if sum(name in heading for name in ("dx", "dy", "dz")) != (0 if "direction" in heading else 3):
        faults.append("directions unclear: either direction or dx,dy,dz")
    if faults:
        raise InputError(faults[0], expected=f"columns of {', '.join(known)}", file=file, line=1)


def _value(name: str, cell: str) -> float | int | str:
    """Value of a cell; ValueError says what was expected."""
    if name in TEXTS:
        pattern, expected = TEXTS[name]
        if not re.fullmatch(pattern, cell):
            raise ValueError(expected)
        return int(cell) if name == "clamp" else cell or (DEFAULT_SETUP if name == "setup" else "")
    low, high, default = NUMBERS[name]
    if not cell and default is not None:
        return default
    with suppress(ValueError):
        if low <= float(cell) <= high:
            return float(cell)
    raise ValueError(f"a number from {low:g} to {high:g}")


def new_exercise(folder: str | Path, case: DrawnCase, rules: Rules = NO_OTHER) -> int:
    """Write a blind exercise; returns the number of rows. Raises `InputError`; then nothing is written.

    `rules`: what must not be replaced. An exercise in the folder is not, by default: its sealed truth would be lost.
    """
    return _written(folder, case.nominal.text, case.rows, seal(case), rules)


def new_robot(folder: str | Path, seed: int, hidden: str | None, noise: float, rules: Rules = NO_OTHER) -> int:
    """Write an exercise on an invented robot (`robot`), as `new_exercise`."""
    text, table, truth = robot_case(seed, hidden, noise)
    sealed = sealed_bytes({"seed": seed, "layout": "robot", "truth": truth, "built": "serial"})
    return _written(folder, text, table, sealed, rules)


def _written(folder: str | Path, machine: str, table: Table, sealed: bytes, rules: Rules) -> int:
    contents: dict[str, Content] = {MACHINE: machine, MEASUREMENTS: csv_text(table), SEALED: sealed}
    write_folder(folder, contents, command="rig new", rules=rules)
    return len(next(iter(table.values())))


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
    return csv_text(case.again(plan, rng, "sd_N_per_mm" in sealed["columns"])), len(plan["x_mm"])


def reveal(folder: str | Path, claim: str) -> dict[str, Any]:
    """Hidden truth and score of a claim: `verdict`, `claim`, `hidden`, `kind`, `effects`, `seed`, `layout`."""
    claims = [name.strip() for name in claim.split(",") if name.strip()]
    names = (name for kind in HIDEABLE.values() for name in sorted(kind.names or ()))
    known = dict.fromkeys((*SOUND, *OTHER, *HIDEABLE, *names))
    alone = len(claims) == 1 or (claims and not {*SOUND} & {*claims})
    if not alone or not {*claims} <= {*known}:
        raise InputError(f"a claim {claim!r}", expected=f"none, or one or several of {', '.join(known)}")
    sealed = opened(Path(folder) / SEALED)
    truth = sealed["truth"]
    # A fault of elements is claimed by the catalogue's name for it, if it has one.
    hidden = [
        next((name for name in claims if name in effect.get("names", ())), effect["effect"])
        for effect in truth["effects"]
    ]
    verdict = {"verdict": score(hidden, claims), "claim": claims}
    return {**verdict, **truth, "seed": sealed["seed"], "layout": sealed["layout"]}
