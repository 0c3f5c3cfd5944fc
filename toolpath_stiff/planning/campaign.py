"""A good first campaign, before anything is known of a machine.

What it must hold, so that most effects can be told from each other later: at least four heights and half of the
poses tilted by 15 to 25 degrees (links above the platform against links below); two loads (what depends on the load);
two tool lengths at some poses; one pose with and without a riser; one pose with its images turned by 120 and 240
degrees about the machine's axis, which only a machine that is not threefold tells apart; places that are clamped anew,
so that the scatter is known; random order, so that a drift looks like nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import AnyArray, FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.evidence import LAW_PRIOR
from toolpath_stiff.inference.judgement import NONE
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.forecasts import forecast_all
from toolpath_stiff.planning.gaps import ReadingNoise, pair_shares, repeat_and_clamping
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.rivals import unfitted_rivals
from toolpath_stiff.planning.visits import (
    AXES,
    READING_EVERY,
    Visits,
    axis_levels,
    draw_poses,
    reachable,
    tilts,
    visits_of,
)
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.units import RAD_PER_DEG

FEWEST, MOST = 8, 200  # poses
LEAST_TILT = 15.0 * RAD_PER_DEG
IMAGES = 3
LONG_TOOL_SHARE, CLAMPINGS = 6, 3  # every sixth pose with a longer tool; two poses clamped three times a set-up
TRIES = 600  # poses to choose from
SHOWS = 3.0  # standard deviations from which an effect counts as visible


@dataclass(frozen=True)
class Campaign:
    """Visits of a campaign, in measuring order.

    Attributes
    ----------
    visits
        The visits, in measuring order; the rounds of a reading say which repeat of its place the visit is.
    kinds
        What each is for.
    noise
        Relative sd of a reading, re-clamping included.
    sees
        Effect -> gap in standard deviations between it, at its usual size, and nothing.
    """

    visits: Visits
    kinds: tuple[str, ...]
    noise: float
    sees: Mapping[str, float]
    notes: tuple[str, ...] = ()

    @property
    def chosen(self) -> Sequence[int]:
        """Numbers of the visits: all of them."""
        return range(len(self.visits))

    @property
    def why(self) -> tuple[str, ...]:
        """Purpose of each visit."""
        return self.kinds

    @property
    def poses(self) -> int:
        """Number of different poses."""
        return len({pose.tobytes() for pose in self.visits.pose})

    @property
    def minutes(self) -> float:
        """Minutes of work."""
        return self.visits.minutes(self.chosen)

    @property
    def sentences(self) -> list[str]:
        """Sentences on the work it takes, and on effects that it would not show."""
        hidden = ", ".join(name for name, gap in self.sees.items() if gap < SHOWS)
        lines = [
            f"{self.poses} poses at {len(np.unique(np.round(self.visits.pose[:, 2], 9)))} heights, {len(self.visits)} "
            f"clampings, {len(self.visits.readings)} readings: about {self.minutes / 60.0:.0f} hours"
        ]
        if hidden:
            noise = f"{100.0 * self.noise:.3g} % noise"
            lines.append(f"of usual size and alone, these would not show at {noise}: {hidden}")
        return lines

    def head(self) -> Document:
        """First entries of plan.json."""
        return {
            "kind": "campaign",
            "poses": self.poses,
            "readings": len(self.visits.readings),
            "minutes": self.minutes,
            "detectability": [{"effect": name, "separation_sigma": gap} for name, gap in self.sees.items()],
        }


def first_campaign(
    machine: Hexapod,
    n: int = 24,
    menu: Menu | None = None,
    seed: int = 0,
    effects: Mapping[str, Effect] | None = None,
    noise: float | tuple[float, float] = 0.02,
    effect_files: Sequence[str | Path] = (),
) -> Campaign:
    """A campaign of n poses, all reachable, along X, Y and Z under the smallest and the largest load of the menu.

    Parameters
    ----------
    machine
        What is to be measured.
    n
        Poses; some are visited again with a longer tool, on a riser, or clamped anew.
    menu
        What may vary: radius, tilt, heights, loads, tool lengths, set-ups; what work costs.
    seed
        Of poses and order.
    effects
        Name -> effect: which it is to be seen whether the campaign would show them.
    noise
        Relative sd of a reading, re-clamping included, or (repeat, clamping), for that.
    effect_files
        A user's own effects.

    Raises
    ------
    InputError
        Too few or too many poses, or the machine does not reach as many.
    """
    if not FEWEST <= n <= MOST:
        raise InputError(f"a first campaign of {n} poses", expected=f"{FEWEST} to {MOST}")
    menu = menu or Menu.of(None)
    rng = np.random.default_rng(seed)
    poses = _poses(machine, menu, n, rng)
    which, extension, setup, kinds = _stops(machine, poses, menu, rng)
    loads = tuple(dict.fromkeys((min(menu.loads), max(menu.loads))))
    names, forces = (np.array(column) for column in zip(*product(AXES, loads), strict=True))
    orders = np.array([rng.permutation(len(names)) for _ in which])
    places = list(zip(which.tolist(), extension.tolist(), setup.tolist(), strict=True))
    repeat = np.array([[places[: k + 1].count(place)] for k, place in enumerate(places)])
    time = READING_EVERY * np.arange(1.0, len(names) + 1.0)
    visits = visits_of(menu, (poses[which], extension, setup), names[orders], forces[orders], time, repeat)
    noises = repeat_and_clamping(noise)
    sees = {} if effects is None else _sees(machine, visits, effects, noises, effect_files)
    return Campaign(visits, tuple(kinds.tolist()), float(np.hypot(*noises)), sees)


def _poses(machine: Hexapod, menu: Menu, n: int, rng: Generator) -> FloatArray:
    """(n, 6) poses as unlike each other as possible: one and its images, others vertical, then n // 2 tilted."""
    levels = menu.heights or axis_levels(machine)
    if len(levels) < 4:
        raise InputError(f"heights of a first campaign: {len(levels)}", expected="4 or more")
    drawn = np.concatenate([draw_poses(machine, menu, TRIES // 4, rng) for _ in range(4)])
    tilt, largest = tilts(drawn), menu.max_tilt
    upright, tilted = drawn[tilt == 0.0], drawn[(tilt >= min(LEAST_TILT, 0.6 * largest)) & (largest > 0.0)]
    scale = np.array([menu.radius, menu.radius, np.ptp(levels) / 2.0, *[max(largest, 1e-3)] * 3])
    chosen = _images(machine, upright, levels[len(levels) // 2], menu)
    for pool, count in ((upright, n - (n // 2 if len(tilted) else 0)), (tilted, n)):
        while len(chosen) < count and len(pool):  # the pose farthest from all those chosen so far
            apart = np.linalg.norm((pool[:, None] - chosen[None]) / scale, axis=2).min(axis=1, initial=np.inf)
            best = int(np.argmax(apart))
            if apart[best] < 1e-9:
                break
            chosen = np.concatenate([chosen, pool[best : best + 1]])
    if len(chosen) < n:
        raise InputError(
            f"machine {machine.name} reaches only {len(chosen)} of {n} poses of a first campaign",
            hint="ask for fewer, or allow a larger radius or more tilt",
        )
    return chosen


def _images(machine: Hexapod, upright: FloatArray, height: float, menu: Menu) -> FloatArray:
    """(3, 6) a vertical pose off the axis near that height and its two images; (0, 6) if out of reach."""
    off = np.hypot(upright[:, 0], upright[:, 1])
    candidates = upright[off > 0.4 * menu.radius]
    angles = 2.0 * np.pi / IMAGES * np.arange(IMAGES)
    for index in np.lexsort((-off[off > 0.4 * menu.radius], np.abs(candidates[:, 2] - height))):
        x, y = candidates[index, :2]
        turned = np.repeat(candidates[index : index + 1], IMAGES, axis=0)
        turned[:, 0], turned[:, 1] = np.cos(angles) * x - np.sin(angles) * y, np.sin(angles) * x + np.cos(angles) * y
        turned[:, :2] = np.round(turned[:, :2], 4)
        if reachable(machine, turned, 0.0).all():
            return turned
    return np.zeros((0, 6))


def _stops(machine: Hexapod, poses: FloatArray, menu: Menu, rng: Generator) -> tuple[AnyArray, ...]:
    """Stops of a campaign: numbers of their poses, tool extensions, set-ups, purposes.

    At random within a set-up and a tool, which are changed as seldom as can be.
    """
    n, tool, setup = len(poses), menu.tool_extensions[0], menu.setups[0]
    kinds = ["image" if k < IMAGES else "tilted" if pose[3:].any() else "vertical" for k, pose in enumerate(poses)]
    stops = [(k, tool, setup, kind) for k, kind in enumerate(kinds)]
    for extension in menu.tool_extensions[1:]:
        fits = np.flatnonzero(reachable(machine, poses, extension)).tolist()
        spread = np.unique(np.linspace(0, max(len(fits) - 1, 0), max(n // LONG_TOOL_SHARE, 2)).astype(int))
        stops += [(fits[k], extension, setup, "longer tool") for k in spread[: len(fits)]]
    again = (0, n - 1)  # the first image and the last pose, which is tilted
    stops += [(k, tool, other, f"set-up {other}") for other in menu.setups[1:] for k in again]
    stops += [(k, tool, name, "clamped anew") for name, k, _ in product(menu.setups, again, range(1, CLAMPINGS))]
    number, extensions, setups, purposes = (np.array(column) for column in zip(*stops, strict=True))
    equipped = list(dict.fromkeys(zip(extensions.tolist(), setups.tolist(), strict=True)))
    group = np.array([equipped.index(pair) for pair in zip(extensions.tolist(), setups.tolist(), strict=True)])
    order = rng.permutation(len(stops))
    order = order[np.argsort(group[order], kind="stable")]
    return number[order], extensions[order], setups[order], purposes[order]


def _sees(
    machine: Hexapod,
    visits: Visits,
    effects: Mapping[str, Effect],
    noise: tuple[float, float],
    effect_files: Sequence[str | Path],
) -> dict[str, float]:
    """Gap in standard deviations between each effect at its usual size and no effect, the strut law refitted."""
    installed = {entry.name for entry in (*machine.effects, *machine.instruments)}
    names = [NONE, *(name for name in effects if name not in installed)]
    rivals = unfitted_rivals(names, effects, setup=visits.menu.setups[-1])
    rivals = [replace(rival, covariance=LAW_PRIOR**2 * np.eye(2), free=()) for rival in rivals]
    (nothing, *forecasts), _, scatter = forecast_all(machine, rivals, visits.readings, effect_files)
    reading_noise = ReadingNoise(*noise, scatter)
    return {
        forecast.name: pair_shares(visits, nothing, forecast, reading_noise).gap(np.arange(len(visits)))
        for forecast in forecasts
        if np.isfinite(forecast.mean).all()
    }
