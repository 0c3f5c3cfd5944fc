"""A blind exercise as a folder: measurements.csv, machine.toml and sealed.bin; measuring again; opening the seal."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, write_atomically
from toolpath_stiff.results_folder import Rules, check_folder, write_folder
from toolpath_stiff.rig.campaign import clamp_of
from toolpath_stiff.rig.case import again, draw_case
from toolpath_stiff.rig.effects import CATALOGUE
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.rig.outside import OUTSIDE
from toolpath_stiff.rig.seal import score, seal, unseal
from toolpath_stiff.rig.tables import csv_text, read_plan

MEASUREMENTS, MACHINE, SEALED = FILES = "measurements.csv", "machine.toml", "sealed.bin"
NO_OTHER = Rules(fresh=True)


def new_exercise(
    folder: str | Path,
    seed: int,
    layout: str = "tilted",
    hidden: str | None = None,
    noise: float = 0.02,
    machine: str = "nist",
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
    """Measure the hidden machine of an exercise at a plan; returns the number of rows.

    New clamps and new noise, which depend on the plan's bytes and on `visit` alone. Clamps are numbered on from a
    number that no other plan is likely to get, so that files can be read together.
    """
    if visit < 0:
        raise InputError(f"visit {visit}", expected="0 or more")
    case, sealed = unseal(Path(folder) / SEALED)
    plan = read_plan(plan_file, case.nominal)
    digest = hashlib.sha256(Path(plan_file).read_bytes()).digest()
    rng = np.random.default_rng([sealed["seed"], visit, int.from_bytes(digest[:8], "big")])
    if "clamp" in plan or "clamp" in sealed["columns"]:
        first = sealed["clamps"] + 1000 * int(rng.integers(1, 10**4))
        plan["clamp"] = first + (plan["clamp"] if "clamp" in plan else clamp_of(plan) + 1)
    stated_sd = "sd_N_per_mm" in sealed["columns"]
    measured = again(case.nominal, case.machine, case.nuisances, plan, rng, stated_sd)
    write_atomically(out, csv_text(measured))
    return len(plan["x_mm"])


def reveal(folder: str | Path, claim: str) -> dict[str, Any]:
    """What was hidden, and how the claim scores: `verdict`, `claim`, `hidden`, `kind`, `effects`, `seed`, `layout`."""
    claims = [name.strip() for name in claim.split(",") if name.strip()]
    known = ("none", "adequate", "outside", "unexplained", *CATALOGUE, *OUTSIDE)
    for name in claims:
        if name not in known:
            raise InputError(f"a claim {name!r}", expected=f"one or several of {', '.join(known)}")
    if not claims or (len(claims) > 1 and {"none", "adequate"} & set(claims)):
        raise InputError(f"a claim {claim!r}", expected="names of effects, or none alone")
    case, sealed = unseal(Path(folder) / SEALED)
    return {
        "verdict": score(case.truth["hidden"], claims),
        "claim": claims,
        **case.truth,
        "seed": sealed["seed"],
        "layout": sealed["layout"],
    }
