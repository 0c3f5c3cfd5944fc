"""Makes pocket_slots.csv and pocket_points.csv: what a dynamometer and a measuring machine say of the cut of pocket.nc.

    python programs/make_cut_data.py

A simulated shop, for tutorial 5: its aluminium is 20 % harder than that of pocket_cut.toml, its cutter runs out by
4 um, and the clamping gave way by 8 um while line 68 was cut. Forces are sums over slices of the teeth, written here
from the mechanics alone; errors of the walls are those of the tool itself with these coefficients.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.cutting.setup import read_setup
from toolpath_stiff.cutting.surface_error import shares
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.stiffness.model import build_model

HERE = Path(__file__).resolve().parent
HARDER = 1.2
CUTTING = HARDER * np.array([767.0, 169.0, 222.0])  # N/mm2, tangential, radial, axial
EDGE = HARDER * np.array([27.7, 26.6, 0.7])  # N/mm
RADIUS, TEETH, HELIX, DEPTH, RUN_OUT = 5.0, 3, np.radians(30.0), 3.0, 0.004  # mm
FEEDS = (0.02, 0.035, 0.05, 0.065, 0.08)  # mm a tooth
RPM, TURNS, PER_TURN, SLICES = 6000, 12, 50, 60
LOOSE_LINE, LOOSE = 68, 8e-6  # m
NOISE_N, NOISE_UM = 3.0, 0.4


def force_on_work(feed: float, turn: float) -> np.ndarray:
    """Forces (3,) N on the work in a slot with the first tooth at `turn`: x along the feed, y to its left, z up."""
    total = np.zeros(3)
    heights = (np.arange(SLICES) + 0.5) * DEPTH / SLICES
    radii = RADIUS + RUN_OUT * np.cos(0.7 + 2.0 * np.pi * np.arange(TEETH) / TEETH)
    for tooth in range(TEETH):
        phi = 2.0 * np.pi * (turn - tooth / TEETH) - heights * np.tan(HELIX) / RADIUS
        before = [m * feed * np.sin(phi) + radii[tooth] - radii[tooth - m] for m in range(1, TEETH + 1)]
        chip = np.minimum.reduce(before) * (np.sin(phi) > 0.0)
        cuts = chip > 0.0
        t, r, a = (cuts * (k * chip + e) * DEPTH / SLICES for k, e in zip(CUTTING, EDGE, strict=True))
        along, left = -t * np.cos(phi) - r * np.sin(phi), t * np.sin(phi) - r * np.cos(phi)
        total += [along.sum(), left.sum(), -a.sum()]
    return -total


def write_slots(rng: np.random.Generator) -> None:
    """pocket_slots.csv: five slots, each from the middle of its cut."""
    with (HERE / "pocket_slots.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["record", "time_s", "fx_N", "fy_N", "fz_N", "feed_per_tooth_mm", "spindle_rpm", "depth_mm"])
        for feed in FEEDS:
            turn = [force_on_work(feed, k / PER_TURN) for k in range(PER_TURN)]
            for k in range(TURNS * PER_TURN):
                forces = turn[k % PER_TURN] + rng.normal(0.0, NOISE_N, 3)
                seconds = k / PER_TURN / (RPM / 60.0)
                rows.writerow([f"f{1000 * feed:g}", f"{seconds:.4f}", *(f"{f:.1f}" for f in forces), feed, RPM, DEPTH])


def write_points(rng: np.random.Generator) -> None:
    """pocket_points.csv: points of the walls, out of the part along nx, ny, nz by deviation_um."""
    model, setup = build_model(load_machine("nist")), read_setup(HERE / "pocket_cut.toml")
    known = setup.coefficients
    harder = Coefficients(HARDER * known.cutting, HARDER * known.edge, known.covariance)
    program = parse_program((HERE / "pocket.nc").read_text(), "pocket.nc")
    tools = {1: replace(setup.tools[1], cutter={**setup.tools[1].cutter, "run_out_um": 1e3 * RUN_OUT})}
    given = replace(setup, coefficients=harder, tools=tools)
    cut = evaluate_cut(model, program, model.machine.default_origin, given, 1e-3)
    station, side = np.nonzero(np.isfinite(cut.wall_mean))
    with (HERE / "pocket_points.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "deviation_um"])
        for i, k in list(zip(station, side, strict=True))[2::6]:
            share = rng.uniform(0.05, 0.95)
            error = np.interp(share, shares()[0], cut.wall_profiles[i, k])
            error += (LOOSE if cut.samples.line[i] == LOOSE_LINE else 0.0) + rng.normal(0.0, NOISE_UM) * 1e-6
            low, high = cut.wall_heights[i, k]
            along = cut.samples.tangent[i, :2] / np.linalg.norm(cut.samples.tangent[i, :2])
            out = np.array([along[1], -along[0]]) * (1.0 if k == 0 else -1.0)
            place = (cut.samples.position[i, :2] - out * cut.cutters[1].radius) * 1e3
            height = (cut.samples.position[i, 2] + low + share * (high - low)) * 1e3
            normal = [f"{v:.4f}" for v in out]
            rows.writerow([*(f"{v:.3f}" for v in (*place, height)), *normal, 0, f"{error * 1e6:.1f}"])


if __name__ == "__main__":
    write_slots(np.random.default_rng(5))
    write_points(np.random.default_rng(27))
