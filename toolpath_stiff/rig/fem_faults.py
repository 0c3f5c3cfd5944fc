"""Faults of the machine of finite elements: soft, loose, worn, misplaced or misread parts.

`links` are those whose give has this signature at the tip (`draws.Hideable`), `names` the effects of the
catalogue, by their titles, that are a right name of the fault; without one it lies outside the catalogue. Limits are
assumed: beyond them a machine would be noticed without a diagnosis; they lie within what the catalogue admits.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Change, Draw, Hideable, Shape, drawn, nothing, one_strut, signed, uniform, whole

SOFT = 80e-9  # m/N, largest compliance that is tried: several times the tip's
CRACKED = 1000.0  # an element's stiffness divided by one more than this is next to none


def _fault(links: str, names: str, limit: float, change: Change, shape: Draw = nothing, needs: str = "") -> Hideable:
    where, right = frozenset(links.split(",")), frozenset(names.split())
    return Hideable(change, limit, shape, tuple(needs.split()), links=where, names=right)


def _grown(name: str, *pattern: float) -> Change:
    """Add the size, times a pattern, to a field."""
    return lambda m, p: {name: getattr(m, name) + (p["size"] * np.array(pattern) if pattern else p["size"])}


def _softened(name: str, hit: Callable[[Shape], Any] = lambda p: True) -> Change:
    """Divide the stiffness factors of the affected elements by 1 + size."""
    return lambda m, p: {name: getattr(m, name) * np.where(hit(p), 1.0 / (1.0 + p["size"]), 1.0)}


def _number(name: str, count: int) -> Callable[[Shape], Any]:
    """Selector of the one element among `count` that was drawn under a name."""
    return lambda p: np.arange(count) == p[name]


def _both(*changes: Change) -> Change:
    return lambda m, p: {key: value for change in changes for key, value in change(m, p).items()}


def _unit(p: Shape) -> FloatArray:
    """Drawn unit vector; horizontal unless the shape has `upward`."""
    upward = p.get("upward", 0.0)
    across = np.sqrt(1.0 - upward**2)
    return np.array([across * np.cos(p["azimuth"]), across * np.sin(p["azimuth"]), upward])


def _about(name: str) -> Change:
    """A compliance in or about one direction, as the vector whose square it is."""
    return lambda m, p: {name: np.sqrt(p["size"]) * _unit(p)}


_azimuth = uniform("azimuth", 0.0, 2.0 * np.pi)
_direction = drawn(_azimuth, uniform("upward", -1.0, 1.0))
_strut = _number("strut", 6)
ONE, ALL, WORK = "one strut,joints", "joints,struts", "table,frame"

FAULTS: dict[str, Hideable] = {
    # In the catalogue, by the titles of its effects.
    "spindle_bearings_soft": _fault("tool", "spindle_compliance", SOFT, _grown("bearings", 1, 1, 0)),
    "spindle_thrust_bearing_soft": _fault("tool", "spindle_compliance", SOFT, _grown("bearings", 0, 0, 1)),
    "platform_soft": _fault("platform", "platform_flexibility", CRACKED, _both(_softened("rim"), _softened("spokes"))),
    "joints_soft": _fault(ALL, "joint_compliance strut_law", SOFT, _grown("joint")),
    "joints_in_contact": _fault(ALL, "contact_nonlinearity joint_compliance strut_law", SOFT, _grown("hertz")),
    "joints_turn_hard": _fault("joints", "joint_moment_stiffness", 1.2e6, _grown("turning", *[1] * 6)),
    "struts_curved": _fault(ALL, "strut_law", 0.3, _grown("curvature"), signed),
    "strut_weak": _fault(ONE, "weak_strut", 1.5, _softened("strut_factors", _strut), one_strut),
    "frame_soft": _fault("frame", "frame_compliance frame_sway", CRACKED, _softened("members")),
    "frame_corner_soft": _fault(
        "frame", "frame_compliance", SOFT,
        lambda m, p: {"brackets": np.outer(_number("corner", 6)(p), [p["size"] * p["radial"], p["size"]])},
        drawn(whole("corner", 0, 3), uniform("radial", 0.2, 1.5)),
    ),
    "table_mounts_soft": _fault("table", "table_compliance", CRACKED, _softened("mounts")),
    "riser_soft": _fault("table", "setup_compliance", SOFT, _grown("riser"), needs="setup"),
    "platform_wide": _fault("platform,joints,geometry", "platform_radius_error", 0.02, _grown("radius_error"), signed),
    "tool_entered_wrong": _fault("tool,geometry", "tool_length_error", 0.04, _grown("tip_error"), signed),
    "cell_scaled": _fault(
        "instrument", "gauge_scale", 0.15,
        lambda m, p: {"gauge_target": "XYZ"[p["axis"]], "gauge_factor": 1.0 + p["size"]},
        drawn(whole("axis", 0, 3), signed),
    ),
    "indicator_drifts": _fault("instrument", "thermal_drift", 2.5e-7, _grown("drift"), signed, "time_min"),
    "tool_slender": _fault("tool", "tool_bending", 3.0, _softened("tool")),
    "frame_feet_soft": _fault(WORK, "frame_sway", CRACKED, _softened("feet")),
    "joint_off_its_place": _fault(
        f"{ONE},platform,frame,geometry", "joint_offset", 0.012,
        lambda m, p: {"platform_errors": m.platform_errors + p["size"] * np.outer(_strut(p), _unit(p))},
        drawn(one_strut, _direction),
    ),
    "indicator_above_tip": _fault("instrument", "indicator_off_tip", 0.06, _grown("touches_above")),
    "cell_curved": _fault("instrument", "load_cell_curvature", 0.3, _grown("cell_curve"), signed, "force_N"),
    "stand_gives": _fault("instrument", "stand_compliance", SOFT, _grown("stand")),
    # Outside the catalogue.
    "spindle_bearing_oval": _fault("tool", "", SOFT, _grown("bearings", 1, 0, 0)),
    "spindle_flange_loose": _fault("tool,platform", "", 4e-6, _about("flange"), _azimuth),
    "platform_plate_bends": _fault("platform", "", CRACKED, _softened("spokes")),
    "platform_cracked": _fault(  # around a joint: its spoke and the two pieces of the rim that meet there
        f"platform,{ONE}", "", CRACKED,
        _both(
            _softened("spokes", _number("corner", 6)),
            _softened("rim", lambda p: np.isin(np.arange(6), [p["corner"], (p["corner"] - 1) % 6])),
        ),
        whole("corner", 0, 6),
    ),
    "frame_beam_cracked": _fault("frame", "", CRACKED, _softened("members", _number("beam", 24)), whole("beam", 0, 12)),
    "frame_diagonals_soft": _fault("frame", "", CRACKED, _softened("members", lambda p: np.arange(24) >= 6)),
    "frame_foot_soft": _fault(WORK, "", CRACKED, _softened("feet", _number("foot", 6)), whole("foot", 0, 3)),
    "table_side_soft": _fault(  # two neighbours of the four mounts
        WORK, "", CRACKED,
        _softened("mounts", lambda p: np.isin(np.arange(4), ((0, 1), (0, 2), (1, 3), (2, 3))[p["edge"]])),
        whole("edge", 0, 4),
    ),
    "table_plate_thin": _fault(WORK, "", CRACKED, _softened("plate")),
    "floor_tilts": _fault(WORK, "", 1e-7, _about("floor"), _azimuth),
    "joint_seat_soft": _fault(
        f"{ONE},platform", "", 4 * SOFT, _both(_about("seat"), lambda m, p: {"seat_strut": p["strut"]}),
        drawn(one_strut, _direction),
    ),
    "joints_soften_swinging": _fault(ALL, "", 8 * SOFT, _grown("swing")),
    # The weight closes a play until a load beyond it opens it: the catalogue's is there at any load.
    "joints_loose": _fault(ALL, "", 8e-5, _grown("clearance"), needs="force_N"),
    "joints_open": _fault(ALL, "", SOFT, _grown("opening")),
    "nut_worn": _fault(
        ONE, "", SOFT, lambda m, p: {"worn": np.array([p["strut"], p["start"], p["size"]])},
        drawn(one_strut, uniform("start", 0.0, 0.8)),
    ),
    "guide_binds": _fault(
        f"{ALL},one strut", "", 4e6, lambda m, p: {"turning": m.turning + p["size"] * _strut(p)}, one_strut
    ),
    "hose_pulls": _fault(
        "platform,tool", "", 4e7, lambda m, p: {"hose": np.array([p["size"], p["azimuth"]])}, _azimuth
    ),
}  # fmt: skip
