"""`python -m benchmarks.placement`: the placement search against a brute-force grid of 20,000 placements.

A path of 10,000 samples, four free variables (x, y, z, rotation). Bars: no placement of the grid better by more than
0.1 % in the recommended objective; hypervolume of the front at least that of the grid's front; at least 30 points on
the front; at least 10 times fewer pose evaluations than the grid; 20 s of CPU.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.machine import load_machine
from toolpath_stiff.nc import read_program
from toolpath_stiff.path import move_lengths
from toolpath_stiff.placement.batch import Evaluator, WorkPath, work_path
from toolpath_stiff.placement.search import OBJECTIVES, Bounds, score, search_placements
from toolpath_stiff.stiffness.model import build_model

SAMPLES = 10_000
GRID = (11, 11, 11, 15)  # 19,965 placements; with 35 at random beside: 20,000
BOUNDS = Bounds(np.array([-0.3, -0.3, 0.4, 0.0, 0.0, 0.0]), np.array([0.3, 0.3, 1.25, 0.0, 0.0, 2.0 * np.pi]))
PROGRAMS = ("case_study", "pocket", "arcs_in_planes")
BETTER, FEWER, POINTS, CPU_SECONDS = 1e-3, 10.0, 30, 20.0


def ten_thousand(name: str) -> WorkPath:
    """A program sampled to about 10,000 samples."""
    program = read_program(Path(__file__).parent.parent / "programs" / f"{name}.nc")
    length = move_lengths(program.moves)[program.moves.motion != 0].sum()
    return work_path(program, float(length) / (SAMPLES - program.moves.motion.size))


def grid_placements() -> np.ndarray:
    """20,000 placements over the bounds."""
    axes = [np.linspace(BOUNDS.low[i], BOUNDS.high[i], n) for i, n in zip((0, 1, 2), GRID[:3], strict=True)]
    axes.append(np.linspace(0.0, 2.0 * np.pi, GRID[3], endpoint=False))
    x, y, z, c = (g.ravel() for g in np.meshgrid(*axes, indexing="ij"))
    placements = np.column_stack([x, y, z, np.zeros_like(x), np.zeros_like(x), c])
    more = BOUNDS.placements(np.random.default_rng(0).uniform(size=(20_000 - len(placements), 4)))
    return np.vstack([placements, more])


def hypervolume(mean: np.ndarray, spread: np.ndarray, reference: tuple[float, float]) -> float:
    """Area that a front dominates up to a reference (low mean, wide range); both in N/um."""
    order = np.argsort(-mean)
    area, widest = 0.0, reference[1]
    for i in order:
        if mean[i] > reference[0] and spread[i] < widest:
            area += (mean[i] - reference[0]) * (widest - spread[i])
            widest = spread[i]
    return area


def measure(name: str, objective: str) -> tuple[str, bool]:
    """One row of the table."""
    model, load, path = build_model(load_machine("nist")), parse_load("tangential"), ten_thousand(name)
    grid = grid_placements()
    evaluator = Evaluator(model, path, load, 1000.0)
    brute = evaluator.figures(grid)
    start = time.process_time()
    found = search_placements(model, path, load, BOUNDS, objective=objective)
    cpu = time.process_time() - start
    best_of_grid = float(score(brute, objective).max())
    ours = float(score(found.best_figures, objective)[0])
    gap = (best_of_grid - ours) / abs(best_of_grid)
    fewer = evaluator.poses / found.pose_evaluations
    feasible = brute.margin >= 0.0
    reference = (
        1e-6 * min(float(brute.mean[feasible].min()), float(found.figures.mean.min())),
        1e-6 * max(float(brute.spread[feasible].max()), float(found.figures.spread.max())),
    )
    volumes = [
        hypervolume(1e-6 * m, 1e-6 * s, reference)
        for m, s in ((found.figures.mean, found.figures.spread), (brute.mean[feasible], brute.spread[feasible]))
    ]
    passed = gap <= BETTER and volumes[0] >= volumes[1] and fewer >= FEWER and cpu <= CPU_SECONDS
    passed &= len(found.front) >= POINTS
    row = (
        f"| {name} | {objective} | {len(path)} | {ours / 1e3:,.0f} | {best_of_grid / 1e3:,.0f} | {100 * gap:+.3f} % | "
        f"{volumes[0] / volumes[1]:.4f} | {len(found.front)} | {fewer:.1f} | {cpu:.1f} | {'yes' if passed else 'NO'} |"
    )
    return row, passed


def main() -> int:
    """Print the table; `--out FILE` writes it too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.placement", description=__doc__)
    parser.add_argument("--out", help="write the table to this file as well")
    args = parser.parse_args()
    lines = [
        "| program | objective | samples | search, N/mm | grid, N/mm | grid better by | hypervolume over grid's | "
        "front | fewer pose evaluations | CPU s | bars cleared |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    passed = True
    for name in PROGRAMS:
        for objective in OBJECTIVES if name == PROGRAMS[0] else OBJECTIVES[:1]:
            row, clears = measure(name, objective)
            lines.append(row)
            passed &= clears
            print(row, flush=True)
    text = "\n".join(["# Placement search against a grid of 20,000", "", *lines, ""])
    if args.out:
        Path(args.out).write_text(
            f"{text}\nMade by `python -m benchmarks.placement --out {args.out}`.\n", encoding="utf-8"
        )
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
