"""Checks of the readings that need no stiffness model, only the machine's symmetry and the principles of mechanics.

- Threefold symmetry: a tensor that a turn by 120 degrees leaves alone is isotropic across the axis, so that X and Y are
  equally stiff on the axis of a machine whose three legs are alike; and a pose turned by 120 degrees about the axis has
  the same stiffness along the turned direction, and the same 1/k_x + 1/k_y.
- Proportionality (Hooke): the stiffness does not depend on the size of the load.
- Set-ups: one pose and direction measured in two set-ups differ only by what the set-ups add.
- Reciprocity (Maxwell, Betti): C_xy = C_yx; needs the displacement across the load, which these data do not carry.

Every check is a combination of ln readings that has mean zero if the principle holds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.residuals import directions, radius
from toolpath_stiff.inference.covariances import Covariance
from toolpath_stiff.inference.repeats import repeat_groups
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.units import mm_from_m

SAME = 1e-3  # m, poses and joints closer than this are one


UPRIGHT = 1e-3  # rad


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
    size
        Of a combination that is not linear, of which `weights` are the derivatives; None: `weights` of ln readings.
    """

    check: str
    weights: FloatArray
    text: str
    broken: str
    size: float | None = None


@dataclass(frozen=True)
class CheckOutcome:
    """The outcome of a check."""

    check: str
    holds: bool
    percent: float
    standard_error_percent: float
    statistic: float
    p_adjusted: float
    text: str


@dataclass(frozen=True)
class NotChecked:
    """A check that these data do not allow."""

    check: str
    reason: str


def symmetries(machine: Hexapod) -> list[FloatArray]:
    """(3, 3) turns by 120 and 240 degrees about Z and mirrors that leave the machine's joints as they are."""
    candidates = []
    for degrees, sign in [(120.0, 1.0), (240.0, 1.0), *((2.0 * half, -1.0) for half in range(0, 180, 30))]:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        candidates.append(np.array([[c, -sign * s, 0.0], [s, sign * c, 0.0], [0.0, 0.0, 1.0]]))

    def maps(q: FloatArray, joints: FloatArray) -> bool:
        distance = np.linalg.norm((joints @ q.T)[:, None] - joints[None], axis=-1)
        return bool((distance.min(axis=1) < SAME).all())

    return [q for q in candidates if maps(q, machine.frame_joints) and maps(q, machine.platform_joints)]


def model_free_checks(machine: Hexapod, data: Readings) -> tuple[list[Check], list[NotChecked]]:
    """The checks that n readings allow; for the others, why not."""
    cells, turns = _cells(data), symmetries(machine)
    threefold = sum(np.linalg.det(q) > 0 for q in turns) == 2
    kinds: list[tuple[str, list[Check], str]] = [
        ("reciprocity", [], "needs the displacement across the load: no column of a measurement file holds it"),
        (
            ON_AXIS,
            list(_on_axis(data, cells)) if threefold else [],
            "no pose on the axis was measured along X and Y with the spindle vertical"
            if threefold
            else "a turn by 120 degrees does not leave this machine's joints as they are",
        ),
        (
            IMAGES,
            list(_images(data, cells, turns)),
            "no two poses are images of each other under the machine's symmetry"
            if turns
            else "the machine has no symmetry",
        ),
        ("proportionality", list(_proportionality(data)), "no pose was measured at two loads"),
        ("set-ups", list(_setups(data)), "no pose was measured in two set-ups"),
    ]
    cannot = [NotChecked(name, reason) for name, checks, reason in kinds if not checks]
    return [check for _, checks, _ in kinds for check in checks], cannot


def assess(checks: list[Check], data: Readings, covariance: Covariance, draws: FloatArray) -> list[CheckOutcome]:
    """Size, statistic and adjusted probability of every check.

    `draws` (m, n): simulated scatter, in which the largest statistic of all checks is looked up as well.
    """
    if not checks:
        return []
    weights = np.array([check.weights for check in checks])
    sd = np.sqrt(covariance.squares(weights))
    logs = np.log(data.stiffness)
    value = np.array([check.weights @ logs if check.size is None else check.size for check in checks])
    largest = np.abs(draws @ (weights / sd[:, None]).T).max(axis=1)
    outcomes = []
    for check, size, spread in zip(checks, value.tolist(), sd.tolist(), strict=True):
        p = (1.0 + float((largest >= abs(size) / spread).sum())) / (1.0 + len(largest))
        holds = p >= 0.05
        percent, error = 100.0 * np.expm1(size), 100.0 * spread
        text = check.text.format(percent=f"{percent:+.2g} % (scatter alone: +-{2 * error:.2g} %)")
        text = f"{text}: {'no more than scatter' if holds else check.broken}"
        outcomes.append(CheckOutcome(check.check, holds, percent, error, size / spread, p, text))
    return outcomes


def _cells(data: Readings) -> dict[tuple[Any, ...], NDArray[np.int64]]:
    """Rows of one pose, tool, set-up, loop, load and direction: (pose, rest, direction) -> rows."""
    groups = repeat_groups(data)
    cells = {}
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        i = int(rows[0])
        pose = (*np.round(data.position[i], 6).tolist(), *np.round(data.angles[i], 6).tolist())
        rest = (float(data.tool_extension[i]), float(data.force[i]), str(data.setup[i]), str(data.loop[i]))
        cells[(pose, rest, tuple(np.round(data.direction[i], 6).tolist()))] = rows
    return cells


def _mean(n: int, rows: NDArray[np.int64], weight: float = 1.0) -> FloatArray:
    weights = np.zeros(n)
    weights[rows] = weight / len(rows)
    return weights


def _on_axis(data: Readings, cells: dict[tuple[Any, ...], NDArray[np.int64]]) -> Iterator[Check]:
    """Differences ln k_x - ln k_y at upright poses on the axis."""
    for (pose, rest, direction), rows in cells.items():
        i = int(rows[0])
        if abs(direction[0]) != 1.0 or radius(data)[i] > SAME or np.abs(data.angles[i, :2]).max() > UPRIGHT:
            continue
        across = next((rows for key, rows in cells.items() if key[:2] == (pose, rest) and abs(key[2][1]) == 1.0), None)
        if across is not None:
            weights = _mean(len(data), rows) - _mean(len(data), across)
            place = f"z = {mm_from_m(float(data.position[i, 2])):.0f} mm" + (f", set-up {rest[2]}" if rest[2] else "")
            yield Check(
                ON_AXIS,
                weights,
                f"On the axis at {place}, X against Y: {{percent}}",
                "the three legs, table or instruments are not alike (table, set-up, gauge, one strut or vertex)",
            )


def _images(
    data: Readings, cells: dict[tuple[Any, ...], NDArray[np.int64]], turns: list[FloatArray]
) -> Iterator[Check]:
    """Two readings, or two sums 1/k_x + 1/k_y, that a symmetry of the machine maps onto each other."""
    n = len(data)
    broken = "the legs are not alike, or something about the machine is not symmetric"
    poses: dict[tuple[Any, ...], dict[tuple[float, ...], NDArray[np.int64]]] = {}
    for (pose, rest, direction), rows in cells.items():
        poses.setdefault((pose, rest), {})[direction] = rows
    for (first, cells_here), (second, cells_there) in combinations(poses.items(), 2):
        if first[1] != second[1] or first[0] == second[0]:
            continue
        i, j = (int(next(iter(rows.values()))[0]) for rows in (cells_here, cells_there))
        q = next((q for q in turns if _is_image(data, q, i, j)), None)
        if q is None:
            continue
        where = f"Point {data.point[i]} and its image {data.point[j]}"
        for direction, rows in cells_here.items():
            for image, rows_there in cells_there.items():
                if abs(float(np.dot(q @ direction, image))) > 1.0 - 1e-6:
                    yield Check(IMAGES, _mean(n, rows) - _mean(n, rows_there), f"{where}, along "
                                f"{_named(direction)}: {{percent}}", broken)  # fmt: skip
        x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        if abs(q[0, 1]) > 1e-9 and {x, y} <= set(cells_here) and {x, y} <= set(cells_there):
            weights, size = np.zeros(n), 0.0
            for sign, which in ((1.0, cells_here), (-1.0, cells_there)):
                softness = {d: float(np.exp(-np.log(data.stiffness[which[d]]).mean())) for d in (x, y)}
                size -= sign * float(np.log(sum(softness.values())))
                for d in (x, y):
                    weights += _mean(n, which[d], sign * softness[d] / sum(softness.values()))
            yield Check(IMAGES, weights, f"{where}, 1/k along X and Y added: {{percent}}", broken, size)


def _is_image(data: Readings, q: FloatArray, i: int, j: int) -> bool:
    turn = data.rotation
    near = float(np.abs(q @ data.position[i] - data.position[j]).max()) < SAME
    return near and float(np.abs(q @ turn[i] @ q.T - turn[j]).max()) < UPRIGHT


def _named(direction: tuple[float, ...]) -> str:
    named: dict[tuple[float, ...], str] = {(1.0, 0.0, 0.0): "X", (0.0, 1.0, 0.0): "Y", (0.0, 0.0, 1.0): "Z"}
    return named.get(tuple(abs(v) for v in direction), "({:.2g}, {:.2g}, {:.2g})".format(*direction))


def _proportionality(data: Readings) -> Iterator[Check]:
    """Slope of ln k over ln F within readings that differ in the load only, for a doubling of the load."""
    if "force_N" in data.missing:
        return
    columns = [np.round(data.position, 6), np.round(data.angles, 6), np.round(data.direction, 6)]
    columns += [data.tool_extension[:, None]]
    columns += [np.unique(v, return_inverse=True)[1].reshape(-1, 1).astype(float) for v in (data.setup, data.loop)]
    groups = np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    log_force = np.log(data.force)
    centred = log_force - (np.bincount(groups, log_force) / np.bincount(groups))[groups]
    along = directions(data)
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
    """Means of the differences between two set-ups at poses and directions measured in both."""
    columns = [np.round(data.position, 6), np.round(data.angles, 6), np.round(data.direction, 6)]
    columns += [data.tool_extension[:, None], data.force[:, None]]
    groups = np.unique(np.concatenate(columns, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    n, along = len(data), directions(data)
    for a, b in combinations(np.unique(data.setup).tolist(), 2):
        for name in np.unique(along):
            both = [
                (rows[data.setup[rows] == a], rows[data.setup[rows] == b])
                for rows in (np.flatnonzero((groups == g) & (along == name)) for g in np.unique(groups))
            ]
            both = [(rows_a, rows_b) for rows_a, rows_b in both if len(rows_a) and len(rows_b)]
            if both:
                weights = sum(_mean(n, rows_a) - _mean(n, rows_b) for rows_a, rows_b in both) / len(both)
                yield Check(
                    "set-ups",
                    np.asarray(weights),
                    f"{name} in set-up {a or '(unnamed)'} against {b or '(unnamed)'}, same pose: {{percent}}",
                    "the set-ups themselves differ in stiffness",
                )
