"""Checks of the readings that need no stiffness model, only the machine's symmetry and the principles of mechanics.

- Threefold symmetry: a tensor that a turn by 120 degrees leaves alone is isotropic across the axis, so that X and Y are
  equally stiff on the axis of a machine whose three legs are alike; and a pose turned by 120 degrees about the axis has
  the same stiffness along the turned direction.
- Proportionality (Hooke): the stiffness does not depend on the size of the load.
- Set-ups: one pose and direction measured in two set-ups differ only by what the set-ups add.

Every check is a combination of ln readings that has mean zero if the principle holds.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions, radius
from toolpath_stiff.inference.covariances import Covariance, Groups, Rows
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import mm_from_m

SAME = 1e-3  # m, poses and joints closer than this are one
UPRIGHT = 1e-3  # rad
SURE = 0.05  # probability, all checks counted, below which a principle does not hold
ON_AXIS, IMAGES = "threefold symmetry on the axis", "symmetric images"


@dataclass(frozen=True)
class Check:
    """A combination of ln readings that should vanish.

    Attributes
    ----------
    check
        Its kind.
    weights
        (n,) of ln readings.
    text
        With {percent} where the size goes: exp of the combination less 1.
    broken
        What it means if it does not vanish.
    """

    check: str
    weights: FloatArray
    text: str
    broken: str


@dataclass(frozen=True)
class CheckOutcome:
    """Outcome of a check."""

    check: str
    holds: bool
    percent: float
    standard_error_percent: float
    statistic: float
    p_adjusted: float
    text: str


def symmetries(machine: MachineTool) -> list[FloatArray]:
    """(3, 3) turns by 120 and 240 degrees about Z and mirrors that leave the machine's joints as they are."""
    turns: list[FloatArray] = []
    if not isinstance(machine, Hexapod):
        return turns
    for degrees, sign in [(120.0, 1.0), (240.0, 1.0), *((2.0 * half, -1.0) for half in range(0, 180, 30))]:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        q = np.array([[c, -sign * s, 0.0], [s, sign * c, 0.0], [0.0, 0.0, 1.0]])
        distances = [
            np.linalg.norm((joints @ q.T)[:, None] - joints[None], axis=-1)
            for joints in (machine.frame_joints, machine.platform_joints)
        ]
        if all((distance.min(axis=1) < SAME).all() for distance in distances):
            turns.append(q)
    return turns


def model_free_checks(machine: MachineTool, data: Readings) -> tuple[list[Check], dict[str, str]]:
    """Checks that n readings allow; for the other checks, the reason why not."""
    cells, turns = Groups.by(repeat_groups(data)).members(), symmetries(machine)
    threefold = sum(np.linalg.det(q) > 0 for q in turns) == 2
    turned = "a turn by 120 degrees does not leave this machine's joints as they are"
    across = "no pose on the axis was measured along X and Y with the spindle vertical"
    kinds = {
        ON_AXIS: (_on_axis(data, cells), across) if threefold else ((), turned),
        IMAGES: (_images(data, cells, turns), "no two readings are images of each other under its symmetry"),
        "proportionality": (_proportionality(data), "no pose was measured at two loads"),
        "set-ups": (_setups(data), "no pose was measured in two set-ups"),
    }
    checks = {name: list(kind) for name, (kind, _) in kinds.items()}
    cannot = {name: reason for name, (_, reason) in kinds.items() if not checks[name]}
    return [check for kind in checks.values() for check in kind], cannot


def assess(checks: list[Check], data: Readings, covariance: Covariance, draws: FloatArray) -> list[CheckOutcome]:
    """Size, statistic and adjusted probability of every check.

    `draws` (m, n): simulated scatter, in which the largest statistic of all checks is looked up as well.
    """
    if not checks:
        return []
    weights = np.array([check.weights for check in checks])
    sd = np.sqrt(covariance.squares(weights))
    largest = np.abs(draws @ (weights / sd[:, None]).T).max(axis=1)
    outcomes = []
    for check, size, spread in zip(checks, (weights @ np.log(data.stiffness)).tolist(), sd.tolist(), strict=True):
        p = (1.0 + float((largest >= abs(size) / spread).sum())) / (1.0 + len(largest))
        percent, error = 100.0 * np.expm1(size), 100.0 * spread
        text = check.text.format(percent=f"{percent:+.2g} % (scatter alone: +-{2 * error:.2g} %)")
        text = f"{text}: {'no more than scatter' if p >= SURE else check.broken}"
        outcomes.append(CheckOutcome(check.check, p >= SURE, percent, error, size / spread, p, text))
    return outcomes


def _mean(n: int, rows: Rows) -> FloatArray:
    weights = np.zeros(n)
    weights[rows] = 1.0 / len(rows)
    return weights


def _on_axis(data: Readings, cells: list[Rows]) -> Iterator[Check]:
    """Checks that ln k_x - ln k_y vanishes at upright poses on the axis."""
    central = (radius(data) <= SAME) & (np.abs(data.angles[:, :2]).max(axis=1) <= UPRIGHT)
    along, poses = directions(data), repeat_groups(data, apart=("direction",))
    on_axis = [rows for rows in cells if central[rows[0]]]
    across = {int(poses[rows[0]]): rows for rows in reversed(on_axis) if along[rows[0]] == "Y"}
    for rows in on_axis:
        i = rows[0]
        if along[i] == "X" and int(poses[i]) in across:
            setup = f", set-up {data.setup[i]}" if data.setup[i] else ""
            yield Check(
                ON_AXIS,
                _mean(len(data), rows) - _mean(len(data), across[int(poses[i])]),
                f"On the axis at z = {mm_from_m(float(data.position[i, 2])):.0f} mm{setup}, X against Y: {{percent}}",
                "the three legs, table or instruments are not alike (table, set-up, gauge, one strut or vertex)",
            )


def _images(data: Readings, cells: list[Rows], turns: list[FloatArray]) -> Iterator[Check]:
    """Checks on pairs of readings that a symmetry of the machine maps onto each other."""
    firsts = np.array([rows[0] for rows in cells])
    place, turn, along = data.position[firsts], data.rotation[firsts], data.direction[firsts]
    alike = repeat_groups(data, apart=("position", "angles", "direction"))[firsts]
    pose = repeat_groups(data, apart=("direction",))[firsts]
    images: set[tuple[int, int]] = set()
    for q in turns:
        axes = zip((place @ q.T).T, place.T, strict=True)
        near = np.logical_and.reduce([np.abs(np.subtract.outer(x, y)) < SAME for x, y in axes])
        a, b = np.nonzero(near & (alike[:, None] == alike) & (pose[:, None] < pose))
        same = np.abs(q @ turn[a] @ q.T - turn[b]).max(axis=(1, 2)) < UPRIGHT
        same &= np.abs(((along[a] @ q.T) * along[b]).sum(axis=1)) > 1.0 - 1e-6
        images |= set(zip(a[same].tolist(), b[same].tolist(), strict=True))
    names = directions(data)
    for first, second in sorted(images):
        rows, others = cells[first], cells[second]
        yield Check(
            IMAGES,
            _mean(len(data), rows) - _mean(len(data), others),
            f"Point {data.point[rows[0]]} and its image {data.point[others[0]]}, along {names[rows[0]]}: {{percent}}",
            "the legs are not alike, or something about the machine is not symmetric",
        )


def _proportionality(data: Readings) -> Iterator[Check]:
    """Checks on the slope of ln k over ln F among readings that differ in load only, per doubling of the load."""
    if "force_N" in data.missing:
        return
    groups = repeat_groups(data, apart=("force",))
    log_force, along = np.log(data.force), directions(data)
    centred = log_force - (np.bincount(groups, log_force) / np.bincount(groups))[groups]
    for name in ["every direction", *np.unique(along)]:
        x = np.where((along == name) | (name == "every direction"), centred, 0.0)
        if float((x**2).sum()) > 1e-6:
            yield Check(
                "proportionality",
                np.log(2.0) * x / float((x**2).sum()),
                f"Load doubled, {name}: {{percent}}",
                "readings depend on the load: contacts, clearance and a drifting indicator make it stiffer with load, "
                "friction softer",
            )


def _setups(data: Readings) -> Iterator[Check]:
    """Checks on the mean difference between two set-ups at poses and directions measured in both."""
    groups = repeat_groups(data, apart=("setup", "loop"))
    n, along, cells = len(data), directions(data), Groups.by(groups).members()
    for a, b in combinations(np.unique(data.setup).tolist(), 2):
        for name in np.unique(along):
            both = [[rows[(along[rows] == name) & (data.setup[rows] == s)] for s in (a, b)] for rows in cells]
            apart = [_mean(n, rows_a) - _mean(n, rows_b) for rows_a, rows_b in both if len(rows_a) and len(rows_b)]
            if apart:
                yield Check(
                    "set-ups",
                    np.asarray(sum(apart) / len(apart)),
                    f"{name} in set-up {a or '(unnamed)'} against {b or '(unnamed)'}, same pose: {{percent}}",
                    "the set-ups themselves differ in stiffness",
                )
