"""Blind cases of the benchmarks: a diagnosis as a record, a large campaign."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.rig import case as case_module
from toolpath_stiff.rig import exercise


def judged(rows: dict[str, Any], truth: dict[str, Any], folder: Path, **stated: Any) -> tuple[dict[str, Any], Document]:
    """Truth, verdict and probabilities of a case as a record, and the whole document; `stated` goes to `diagnose`."""
    file = folder / "measurements.csv"
    file.write_text(exercise.csv_text(rows), encoding="utf-8")
    machine = load_machine("nist")
    start = time.process_time()
    diagnosis = diagnose(machine, read_measurements(file, machine), **stated)
    found = diagnosis.to_dict()
    record = {
        "truth": right_names(truth, found["plausible"]),
        "kind": truth["kind"],
        "effects": truth["effects"],
        "verdict": found["verdict"],
        "plausible": found["plausible"],
        "cpu": round(time.process_time() - start, 2),
    }
    return record, found


def right_names(truth: dict[str, Any], plausible: Sequence[str]) -> list[str]:
    """Of each hidden effect its name; of a fault of finite elements a right one, if there is one in `plausible`."""
    names = [effect.get("names") or [effect["effect"]] for effect in truth["effects"]]
    return [next((name for name in right if name in plausible), right[0]) for right in names]


def campaign(readings: int) -> str:
    """A measurement file of so many readings of one machine, tilted, each pose clamped twice."""
    tables, poses = [], 0
    for seed in range(1000, 1000 + readings // 288 + 1):
        rows, _ = case_module.make_case(seed, hidden="none")
        rows["clamp"] = np.asarray(rows["clamp"]) + 2 * poses
        rows["point"] = np.asarray(rows["point"]) + poses
        poses += len(set(np.asarray(rows["point"]).tolist()))
        tables.append({name: column for name, column in rows.items() if name != "stiffness_N_per_mm"})
    plan = {name: np.concatenate([np.asarray(part[name]) for part in tables])[:readings] for name in tables[0]}
    plan |= {name: plan[name].tolist() for name in ("direction", "setup")}
    return exercise.csv_text(case_module.make_case(3, "campaign", "weak_strut", plan=plan, size=0.06)[0])
