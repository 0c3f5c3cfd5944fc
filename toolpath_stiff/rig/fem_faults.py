"""Faults of the machine of finite elements: what of it is soft, loose, worn, misplaced or misread.

`links` are those whose give has this signature at the tip (words of `unknown.LINKS`), `names` the effects of the
catalogue, by their titles, that are a right name of the fault; without one it lies outside the catalogue. Limits are
assumed: beyond them a machine would be noticed without a diagnosis.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Draw, Shape, drawn, one_strut, signed, uniform, whole
from toolpath_stiff.rig.fem import FemMachine, table_top
from toolpath_stiff.rig.nominal import Nominal

Change = Callable[[FemMachine, float, Shape, Nominal], Shape]
SOFT = 80e-9  # m/N, largest compliance that is tried: several times the tip's
CRACKED = 1000.0  # an element's stiffness divided by one more than this is next to none


@dataclass(frozen=True)
class Fault:
    """A fault: its words, the fields of `FemMachine` that it changes at a size (SI), the largest size, other draws."""

    links: frozenset[str]
    names: frozenset[str]
    limit: float
    change: Change
    shape: Draw
    columns: tuple[str, ...]


def _fault(
    links: str, names: str, limit: float, change: Change, shape: Draw = lambda rng: {}, columns: str = ""
) -> Fault:
    return Fault(frozenset(links.split(",")), frozenset(names.split()), limit, change, shape, tuple(columns.split()))


def _set(name: str, *pattern: float) -> Change:
    """The field becomes the size, times a pattern."""
    return lambda m, size, p, nominal: {name: size * np.array(pattern) if pattern else size}


def _divided(*names: str, by: str = "") -> Change:
    """Stiffness factors fall to 1 / (1 + size); of an array the element that was drawn, or all."""

    def change(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
        changed = {}
        for name in names:
            before: Any = getattr(m, name)
            hit = np.arange(len(before)) == p[by] if by else True
            changed[name] = (
                np.where(hit, 1.0 / (1.0 + size), 1.0) * before if np.ndim(before) else before / (1.0 + size)
            )
        return changed

    return change


def _about(name: str) -> Change:
    """A compliance about one horizontal axis, as a vector whose square it is."""
    return lambda m, size, p, nominal: {
        name: np.sqrt(size) * np.array([np.cos(p["azimuth"]), np.sin(p["azimuth"]), 0.0])
    }


def _unit(p: Shape) -> FloatArray:
    """The unit vector that was drawn by azimuth and height."""
    across = np.sqrt(1.0 - p["upward"] ** 2)
    return np.array([across * np.cos(p["azimuth"]), across * np.sin(p["azimuth"]), p["upward"]])


def _hose(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
    """From the hub to the frame's side, half its radius above the table."""
    radius = float(np.linalg.norm(nominal.frame_joints[:, :2], axis=1).mean())
    place = radius * np.array([np.cos(p["azimuth"]), np.sin(p["azimuth"]), 0.5]) + [0.0, 0.0, table_top(nominal)]
    return {"hose": np.concatenate([[size], place])}


def _worn(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
    """A tenth of the travel, somewhere between the two lengths of the law."""
    first, last = nominal.law_ends
    start = first + p["where"] * 0.8 * (last - first)
    return {"worn": np.array([p["strut"], start, start + 0.3 * (last - first), size])}


def _corner(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
    """The platform around one joint: its spoke and the two pieces of the rim that meet there."""
    around = np.argsort(np.arctan2(nominal.platform_joints[:, 1], nominal.platform_joints[:, 0]))
    after = int(np.flatnonzero(around == p["strut"])[0])
    cracked = {"spokes": np.arange(6) == p["strut"], "rim": np.isin(np.arange(6), [after, (after - 1) % 6])}
    return {name: getattr(m, name) * np.where(hit, 1.0 / (1.0 + size), 1.0) for name, hit in cracked.items()}


def _side(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
    """Two neighbours of the table's four mounts."""
    soft = np.isin(np.arange(4), ((0, 1), (0, 2), (1, 3), (2, 3))[p["side"]])
    return {"mounts": m.mounts * np.where(soft, 1.0 / (1.0 + size), 1.0)}


def _placed(m: FemMachine, size: float, p: Shape, nominal: Nominal) -> Shape:
    moved = m.platform_errors.copy()
    moved[p["strut"]] += size * _unit(p)
    return {"platform_errors": moved}


_azimuth = uniform("azimuth", 0.0, 2.0 * np.pi)
_direction = drawn(_azimuth, uniform("upward", -1.0, 1.0))
_axis = drawn(whole("axis", 0, 3), signed)
ONE, ALL, WORK = "one strut,joints", "joints,struts", "table,frame"

FAULTS: dict[str, Fault] = {
    # In the catalogue, by the titles of its effects.
    "spindle_bearings_soft": _fault("tool", "spindle_compliance", SOFT, _set("bearings", 1, 1, 0)),
    "spindle_thrust_bearing_soft": _fault("tool", "spindle_compliance", SOFT, _set("bearings", 0, 0, 1)),
    "tool_slender": _fault("tool", "spindle_compliance", 3.0, _divided("tool")),
    "platform_soft": _fault("platform", "platform_flexibility", CRACKED, _divided("rim", "spokes")),
    "joints_soft": _fault(ALL, "joint_compliance strut_law", SOFT, _set("joints")),
    "joints_turn_hard": _fault("joints", "joint_moment_stiffness", 2e6, _set("turning", *[1] * 6)),
    "joints_in_contact": _fault(
        ALL, "contact_nonlinearity joint_compliance strut_law", SOFT, _set("contact"), columns="force_N"
    ),
    "struts_curved": _fault(ALL, "strut_law", 0.4, _set("curvature"), signed),
    "strut_weak": _fault(ONE, "weak_strut", 2.3, _divided("strut_factors", by="strut"), one_strut),
    "frame_soft": _fault("frame", "frame_compliance", CRACKED, _divided("beams")),
    "frame_vertex_soft": _fault(
        "frame", "frame_compliance", SOFT,
        lambda m, size, p, _: {
            "brackets": size * (np.arange(6) == p["vertex"])[:, None] * np.array([p["radial"], 1.0])
        },
        drawn(whole("vertex", 0, 3), uniform("radial", 0.2, 1.5)),
    ),
    "table_mounts_soft": _fault("table", "table_compliance", CRACKED, _divided("mounts")),
    "riser_soft": _fault(
        "table", "setup_compliance", 2e-7, lambda m, size, p, _: {"riser": 1.0 / size, "riser_setup": "riser"},
        columns="setup",
    ),
    "platform_wide": _fault("platform,joints", "platform_radius_error", 0.06, _set("radius_error"), signed),
    "tool_entered_wrong": _fault("tool", "tool_length_error", 0.06, _set("tip_error"), signed),
    "cell_scaled": _fault(
        "instrument", "gauge_scale", 0.2,
        lambda m, size, p, _: {"gauge": 1.0 + size * np.eye(3)[p["axis"]]}, _axis,
    ),
    "indicator_drifts": _fault("instrument", "thermal_drift", 3.3e-7, _set("drift"), signed, "time_min"),
    # Outside the catalogue.
    "spindle_bearing_oval": _fault("tool", "", SOFT, _set("bearings", 1, 0, 0)),
    "spindle_flange_loose": _fault("tool,platform", "", 4e-6, _about("flange"), _azimuth),
    "platform_plate_bends": _fault("platform", "", CRACKED, _divided("spokes")),
    "platform_cracked": _fault(f"platform,{ONE}", "", CRACKED, _corner, one_strut),
    "frame_beam_cracked": _fault("frame", "", CRACKED, _divided("beams", by="beam"), whole("beam", 0, 12)),
    "frame_foot_soft": _fault(WORK, "", CRACKED, _divided("feet", by="foot"), whole("foot", 0, 3)),
    "frame_feet_soft": _fault(WORK, "", CRACKED, _divided("feet")),
    "frame_diagonals_soft": _fault(
        "frame", "", CRACKED, lambda m, size, p, _: {"beams": m.beams * np.where(np.arange(24) < 6, 1, 1 / (1 + size))}
    ),
    "table_side_soft": _fault(WORK, "", CRACKED, _side, whole("side", 0, 4)),
    "table_plate_thin": _fault(WORK, "", CRACKED, _divided("plate")),
    "floor_tilts": _fault(WORK, "", 1e-7, _about("floor"), _azimuth),
    "joint_seat_soft": _fault(
        f"{ONE},platform", "", 4 * SOFT,
        lambda m, size, p, _: {"seat": np.sqrt(size) * _unit(p), "seat_strut": p["strut"]},
        drawn(one_strut, _direction),
    ),
    "joint_off_its_place": _fault(f"{ONE},platform,frame,geometry", "", 0.03, _placed, drawn(one_strut, _direction)),
    "joints_soften_swinging": _fault(ALL, "", 8 * SOFT, _set("swing")),
    # The weight closes a play until a load beyond it opens it: the catalogue's is there at any load.
    "joints_loose": _fault(ALL, "", 8e-5, _set("clearance"), columns="force_N"),
    "joints_open": _fault(ALL, "", SOFT, _set("opening")),
    "nut_worn": _fault(ONE, "", SOFT, _worn, drawn(one_strut, uniform("where", 0.0, 1.0))),
    "guide_binds": _fault(
        ALL + ",one strut", "", 4e6, lambda m, size, p, _: {"turning": m.turning + size * np.eye(6)[p["strut"]]},
        one_strut,
    ),
    "hose_pulls": _fault("platform,tool", "", 4e7, _hose, _azimuth),
    "indicator_above_tip": _fault("instrument", "", 0.06, _set("touches_above")),
    "cell_curved": _fault("instrument", "", 0.3, _set("cell_curve"), signed, "force_N"),
    "stand_gives": _fault("instrument", "", SOFT, _set("stand")),
}  # fmt: skip
