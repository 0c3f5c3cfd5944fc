"""The paper's machine figures: six lengths fitted to the modelled stiffnesses that its Table 1 prints."""

import csv
from collections.abc import Callable
from importlib import resources
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.model import Hexapod, StrutLaw, as_hexapod
from toolpath_stiff.stiffness.core import tip_compliance
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.units import m_from_mm, mm_from_m, n_per_mm_from_n_per_m, n_per_um_from_n_per_m

UNKNOWNS = (
    "platform radius",
    "platform height above the tip",
    "lower frame joints, radius",
    "lower frame joints, height",
    "upper frame joints, radius",
    "upper frame joints, height",
)
# Plausible sizes of a machine with struts of 2.5 to 3.2 m, in m: the box that the starts are scattered in and that
# bounds the fit (beyond it the strut law vanishes).
SCATTER = np.array([[0.15, 0.6], [0.1, 0.6], [1.5, 3.0], [2.4, 3.6], [1.5, 3.0], [2.4, 3.6]])
HEXAGON_DEG = np.array([30.0, 90.0, 150.0, 210.0, 270.0, 330.0])
VERTEX_DEG = np.array([60.0, 60.0, 180.0, 180.0, 300.0, 300.0])
SAME_OPTIMUM = 1e-4  # m: starts that end this close have found the same geometry
# A value printed to 1 N/mm is off by a uniform error: its standard deviation in N/mm.
ROUNDING_SD = 1.0 / np.sqrt(12.0)
PAPER_CENTRE_LENGTHS = (2.5616, 3.2132)  # m, printed in the paper, never fitted


def table_1() -> tuple[FloatArray, FloatArray]:
    """Positions (14, 3) in m and modelled stiffnesses (14, 3) in N/mm of the packaged Table 1."""
    text = (resources.files("toolpath_stiff") / "data" / "nist_table1.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    position = np.array([[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in rows])
    modelled = np.array([[float(row[f"modeled_{axis}_N_per_mm"]) for axis in "xyz"] for row in rows])
    return m_from_mm(position), modelled


def machine_of(
    lengths: FloatArray, hexagon_twist: float = 0.0, law: StrutLaw | None = None, scale: float = 1.0
) -> Hexapod:
    """The machine of six lengths (m, as `UNKNOWNS`).

    `hexagon_twist` (rad) turns the platform's joints alternately apart, `scale` blows the platform up about the tip
    with the frame joints moved along so that no strut changes direction or length.
    """
    radius, height, lower_radius, lower_height, upper_radius, upper_height = lengths
    angle = np.deg2rad(HEXAGON_DEG) + hexagon_twist * np.array([1, -1, 1, -1, 1, -1])
    platform = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(6, height)])
    vertex, out, up = np.deg2rad(VERTEX_DEG), [lower_radius, upper_radius] * 3, [lower_height, upper_height] * 3
    frame = np.column_stack([out * np.cos(vertex), out * np.sin(vertex), up]) + (scale * platform - platform)
    nist = as_hexapod(load_machine("nist"), "the paper")
    return nist.with_changes(frame_joints=frame, platform_joints=scale * platform, strut_law=law or nist.strut_law)


def modelled_stiffness(machine: Hexapod, position: FloatArray) -> FloatArray:
    """(n, 3) N/mm along X, Y, Z."""
    compliance = tip_compliance(build_model(machine), position)
    return np.asarray(n_per_mm_from_n_per_m(1.0 / np.einsum("nii->ni", compliance)))


def recover_geometry(starts: int = 20, seed: int = 1) -> Document:
    """Fit the six lengths from scattered starts.

    Parameters
    ----------
    starts
        How many starting points.
    seed
        Of their scatter.

    Returns
    -------
    What was found, in mm and N/mm, ready for JSON: lengths with standard errors, how many starts agree, residuals, the
    centre strut lengths that the fit never saw, what stays unidentified.
    """
    from scipy.optimize import least_squares

    position, table = table_1()
    rng, law = np.random.default_rng(seed), as_hexapod(load_machine("nist"), "the paper").strut_law
    # Unknowns are measured in units of their scatter: in metres and N/mm a solver would stop at once.
    low, width = SCATTER[:, 0], SCATTER[:, 1] - SCATTER[:, 0]

    def machine_at(unit: FloatArray) -> Hexapod:
        return machine_of(low + width * unit)

    def freed(x: FloatArray) -> Hexapod:
        """With the hexagon's twist and the two strut stiffnesses free as well."""
        stiff = StrutLaw(law.length_1, law.stiffness_1 * (1 + x[7]), law.length_2, law.stiffness_2 * (1 + x[8]))
        return machine_of(lengths + width * x[:6], float(x[6]), stiff)

    def fit(machine: Callable[[FloatArray], Hexapod], start: FloatArray, bounds: tuple[float, float]) -> Any:
        def residuals(x: FloatArray) -> FloatArray:
            return np.asarray((modelled_stiffness(machine(x), position) - table).ravel())

        return least_squares(
            residuals, start, bounds=bounds, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=500
        )

    fits = [fit(machine_at, rng.uniform(size=6), (0.0, 1.0)) for _ in range(starts)]
    best = min(fits, key=lambda result: float(result.cost))
    lengths, left, machine = low + width * best.x, best.fun, machine_at(best.x)
    errors = width * np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac) * ROUNDING_SD**2))
    free = fit(freed, np.zeros(9), (-np.inf, np.inf)).x
    twist_deg, stiff = float(np.rad2deg(free[6])), freed(free).strut_law
    # A platform that is blown up by a tenth changes nothing, so its scale cannot be fitted.
    blown = modelled_stiffness(machine_of(lengths, scale=1.1), position) - modelled_stiffness(machine, position)
    return {
        "unknowns": [
            {"name": name, "mm": mm_from_m(float(value)), "standard_error_mm": mm_from_m(float(error))}
            for name, value, error in zip(UNKNOWNS, lengths, errors, strict=True)
        ],
        "starts": starts,
        "starts_that_agree": sum(bool(np.abs(width * (fit.x - best.x)).max() < SAME_OPTIMUM) for fit in fits),
        "seed": seed,
        "values": int(left.size),
        "largest_residual_N_per_mm": float(np.abs(left).max()),
        "rms_residual_N_per_mm": float(np.sqrt(np.mean(left**2))),
        "values_to_the_printed_digit": int((np.abs(left) <= 0.5).sum()),
        "centre_strut_lengths_m": [float(solve_struts(machine, position[i]).lengths.mean()) for i in (0, 7)],
        "paper_centre_strut_lengths_m": list(PAPER_CENTRE_LENGTHS),
        "freed_hexagon_angles_deg": [30.0 + twist_deg, 90.0 - twist_deg],
        "freed_stiffness_1_N_per_um": n_per_um_from_n_per_m(stiff.stiffness_1),
        "freed_stiffness_2_N_per_um": n_per_um_from_n_per_m(stiff.stiffness_2),
        "unidentified_scale_changes_N_per_mm": float(np.abs(blown).max()),
    }


def recovery_text(fit: Document) -> str:
    """What `recover_geometry` found, for the terminal."""
    lines = [f"{'fitted to the 42 modelled values of Table 1':<44} {'mm':>10}  standard error"]
    for unknown in fit["unknowns"]:
        lines.append(f"  {unknown['name']:<42} {unknown['mm']:10.3f}  {unknown['standard_error_mm']:.3f}")
    lower, top = fit["centre_strut_lengths_m"]
    angles = fit["freed_hexagon_angles_deg"]
    lines += [
        "  (standard errors: from the table's rounding to 1 N/mm)",
        f"starts that end in this geometry: {fit['starts_that_agree']} of {fit['starts']} (seed {fit['seed']})",
        f"residuals: largest {fit['largest_residual_N_per_mm']:.2f}, rms {fit['rms_residual_N_per_mm']:.2f} N/mm; "
        f"{fit['values_to_the_printed_digit']} of {fit['values']} values to the printed digit",
        f"mean strut length on the axis, never fitted: {lower:.5f} m and {top:.5f} m (the paper: 2.5616 and 3.2132 m)",
        f"freed as well: hexagon at {angles[0]:.3f} and {angles[1]:.3f} degrees, struts "
        f"{fit['freed_stiffness_1_N_per_um']:.3f} and {fit['freed_stiffness_2_N_per_um']:.3f} N/um "
        "(the paper: 46.5 and 32.5)",
        "not identified: the platform's scale about the tip. Blown up by a tenth, frame joints moved along, the",
        f"  values change by {fit['unidentified_scale_changes_N_per_mm']:.1e} N/mm; both joints of a vertex are put",
        "  in the vertex's radial plane to fix it, and tilted poses depend on that. Nor does the table tell platform",
        "  bars stiffer than about 1e12 N/m from rigid ones, or the strut law outside 2.5616 to 3.2132 m.",
    ]
    return "\n".join(lines)
