"""A good first campaign, before anything is known of a machine.

What it must hold, so that most effects can be told from each other later: at least four heights and half of the
poses tilted by 15 to 25 degrees (links above the platform against links below); two loads (what depends on the load);
two tool lengths at some poses; one pose with and without a riser; one pose with its images turned by 120 and 240
degrees about the machine's axis, which only a machine that is not threefold tells apart; places that are clamped anew,
so that the scatter is known; random order, so that a drift looks like nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.evidence import LAW_PRIOR
from toolpath_stiff.inference.judgement import NONE
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.planning.forecasts import forecast_all
from toolpath_stiff.planning.gaps import ReadingNoise, pair_shares, repeat_and_clamping
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.poses import axis_levels, draw_poses, images, reachable
from toolpath_stiff.planning.rivals import unfitted_rivals
from toolpath_stiff.planning.visits import AXES, READING_EVERY, Visits, visits_of
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.units import RAD_PER_DEG

FEWEST, MOST = 8, 200  # poses
LEAST_TILT = 15.0 * RAD_PER_DEG
IMAGES = 3
LONG_TOOL_SHARE, CLAMPINGS = 6, 3  # every sixth pose with a longer tool; two poses clamped three times a set-up
TABLE, RISER = "table", "riser"
TRIES = 600  # poses to choose from
SHOWS = 3.0  # standard deviations from which on an effect is said to show
Stop = tuple[int, float, str, str]  # number of the pose, tool's extension, set-up, purpose


@dataclass(frozen=True)
class Campaign:
    """Visits in measuring order.

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
        """All of them."""
        return range(len(self.visits))

    @property
    def why(self) -> tuple[str, ...]:
        """The purpose of each."""
        return self.kinds

    @property
    def poses(self) -> int:
        """Different poses."""
        return len({pose.tobytes() for pose in self.visits.pose})

    @property
    def minutes(self) -> float:
        """Work."""
        visits, costs = self.visits, self.visits.menu.costs
        minutes = len(visits) * costs.pose + costs.reading * len(visits.readings)
        for before, after in pairwise(zip(visits.setup.tolist(), visits.extension.tolist(), strict=True)):
            minutes += costs.setup * (before[0] != after[0]) + costs.tool * (before[1] != after[1])
        return float(minutes)

    @property
    def sentences(self) -> list[str]:
        """Sentences on what it takes, and what it would not show."""
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
        """The first entries of plan.json."""
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
    menu = menu or Menu(setups=(TABLE, RISER))
    rng = np.random.default_rng(seed)
    poses = _poses(machine, menu, n, rng)
    stops = _stops(machine, poses, menu)
    first = {stop[1:3]: k for k, stop in reversed(list(enumerate(stops)))}
    # At random within a set-up and a tool, which are changed as seldom as can be.
    stops = sorted((stops[k] for k in rng.permutation(len(stops))), key=lambda stop: first[stop[1:3]])
    visits = _visits(poses, stops, menu, rng)
    repeat_clamping = repeat_and_clamping(noise)
    sees = {} if effects is None else _sees(machine, visits, effects, repeat_clamping, effect_files)
    return Campaign(visits, tuple(purpose for _, _, _, purpose in stops), float(np.hypot(*repeat_clamping)), sees)


def _poses(machine: Hexapod, menu: Menu, n: int, rng: Generator) -> FloatArray:
    """(n, 6): one pose and its images, then vertical ones, then n // 2 tilted ones; as unlike each other as can be."""
    levels = menu.heights or axis_levels(machine)
    if len(levels) < 4:
        raise InputError(f"a first campaign at {len(levels)} heights", expected="4 or more")
    drawn = np.concatenate([draw_poses(machine, menu, TRIES // 4, rng) for _ in range(4)])
    tilt = np.arccos(np.clip(np.cos(drawn[:, 3]) * np.cos(drawn[:, 4]), -1.0, 1.0))
    upright = drawn[tilt == 0.0]
    tilted = drawn[tilt >= min(LEAST_TILT, 0.6 * menu.max_tilt)]
    tilted = tilted if menu.max_tilt > 0.0 else drawn[:0]
    n_tilted = n // 2 if len(tilted) else 0
    scale = np.array([menu.radius, menu.radius, np.ptp(levels) / 2.0, *[max(menu.max_tilt, 1e-3)] * 3])
    chosen = _images_of(machine, upright, levels, menu)
    for pool, count in ((upright, n - n_tilted), (tilted, n)):
        chosen = _spread(chosen, pool, count, scale)
    if len(chosen) < n:
        raise InputError(
            f"machine {machine.name} reaches only {len(chosen)} of {n} poses of a first campaign",
            hint="ask for fewer, or allow a larger radius or more tilt",
        )
    return chosen


def _images_of(machine: Hexapod, upright: FloatArray, levels: Sequence[float], menu: Menu) -> FloatArray:
    """(3, 6) a vertical pose off the axis, at a middle height, and its two images, if the machine reaches such."""
    middle = levels[len(levels) // 2]
    off = np.hypot(upright[:, 0], upright[:, 1])
    candidates = upright[(off > 0.4 * menu.radius)]
    order = np.lexsort((-off[off > 0.4 * menu.radius], np.abs(candidates[:, 2] - middle)))
    for index in order:
        three = images(candidates[index])
        three[:, :2] = np.round(three[:, :2], 4)
        if reachable(machine, three, 0.0).all():
            return three
    return np.zeros((0, 6))


def _spread(chosen: FloatArray, pool: FloatArray, count: int, scale: FloatArray) -> FloatArray:
    """The chosen poses and more from the pool, each the farthest from all before it."""
    while len(chosen) < count and len(pool):
        if len(chosen):
            apart = np.linalg.norm((pool[:, None] - chosen[None]) / scale, axis=2).min(axis=1)
            best = int(np.argmax(apart))
            if apart[best] < 1e-9:
                break
        else:
            best = 0
        chosen = np.concatenate([chosen, pool[best : best + 1]])
    return chosen


def _stops(machine: Hexapod, poses: FloatArray, menu: Menu) -> list[Stop]:
    """Stops at the poses: with longer tools, in other set-ups, clamped anew."""
    n, tool, setup = len(poses), menu.tool_extensions[0], menu.setups[0]
    stops = []
    for k, pose in enumerate(poses):
        stops.append((k, tool, setup, "image" if k < IMAGES else "tilted" if pose[3:].any() else "vertical"))
    for extension in menu.tool_extensions[1:]:
        fits = np.flatnonzero(reachable(machine, poses, extension)).tolist()
        spread = np.unique(np.linspace(0, max(len(fits) - 1, 0), max(n // LONG_TOOL_SHARE, 2)).astype(int))
        stops += [(fits[k], extension, setup, "longer tool") for k in spread[: len(fits)]]
    again = (0, n - 1)  # the first image and the last pose, which is tilted
    stops += [(k, tool, other, f"set-up {other}") for other in menu.setups[1:] for k in again]
    return stops + [(k, tool, name, "clamped anew") for name, k, _ in product(menu.setups, again, range(1, CLAMPINGS))]


def _visits(poses: FloatArray, stops: Sequence[Stop], menu: Menu, rng: Generator) -> Visits:
    loads = tuple(dict.fromkeys((min(menu.loads), max(menu.loads))))
    names, forces = (np.array(column) for column in zip(*product(AXES, loads), strict=True))
    orders = np.array([rng.permutation(len(names)) for _ in stops])
    pose, extension, setup, _ = (np.array(column) for column in zip(*stops, strict=True))
    places = [stop[:3] for stop in stops]
    repeat = np.array([places[: k + 1].count(place) for k, place in enumerate(places)])
    time = READING_EVERY * np.arange(1.0, len(names) + 1.0)
    return visits_of(menu, (poses[pose], extension, setup), names[orders], forces[orders], time, repeat[:, None])


def _sees(
    machine: Hexapod,
    visits: Visits,
    effects: Mapping[str, Effect],
    noise: tuple[float, float],
    effect_files: Sequence[str | Path],
) -> dict[str, float]:
    """Gap between each effect at its usual size and nothing, the strut law refitted."""
    installed = {entry.name for entry in (*machine.effects, *machine.instruments)}
    names = [name for name in effects if name not in installed]
    rivals = unfitted_rivals([NONE, *names], effects, setup=visits.menu.setups[-1])
    rivals = [replace(rival, covariance=LAW_PRIOR**2 * np.eye(2), free=()) for rival in rivals]
    forecasts, _, scatter = forecast_all(machine, rivals, visits.readings, effect_files)
    reading_noise = ReadingNoise(*noise, scatter)
    everywhere = np.arange(len(visits))
    return {
        forecast.name: pair_shares(visits, forecasts[0], forecast, reading_noise).gap(everywhere)
        for forecast in forecasts[1:]
        if np.isfinite(forecast.mean).all()
    }
