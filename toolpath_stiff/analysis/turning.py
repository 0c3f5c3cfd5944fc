"""The free turn about the tool's axis on a machine with more joints than a cut needs: fixed, along the feed, or best.

Best are constant turns first: the one with the least mean compliance at which no pose leaves a limit. A turn that
changes along the path is taken where no constant one is feasible, or where it gains.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from toolpath_stiff.analysis.evaluation import Evaluation, Progress, evaluate, evaluate_stance
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.joint_values import TURN
from toolpath_stiff.machine.model import MachineTool
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.path.turning import (
    constant_costs,
    feed_turns,
    least_costly_way,
    room_to_wind,
    turned_about_tool,
    unwound,
)
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import deg_from_rad, nm_from_m, rad_from_deg

FIXED, FEED, BEST = "fixed", "feed", "best"
TURNS = 72  # steps of 5 degrees: compliance is smooth over the turn, neighbours differ by some tenths of a percent
NODES = 200  # poses of a path at which every turn and configuration is tried; between them the turn is interpolated
STEP = 0.35  # rad and m, largest move of a joint between two nodes; assumed: more means another configuration
GAIN = 0.002  # share of the mean compliance that a changing turn must save, for the joints that it moves
WINDOW = 6  # most steps of turn between two nodes
SMOOTH = 1e-3  # of the mean compliance, what a squared step of a joint of 1 rad costs


@dataclass(frozen=True)
class TurnChoice:
    """The turn about the tool's axis along a path.

    Attributes
    ----------
    turn
        (n,) rad.
    abc
        (n, 3) rad, roll, pitch, yaw with the turn.
    configuration
        (n,) numbers among the machine's configurations.
    constant
        Whether both are the same all along.
    changes
        Samples before which the configuration changes, a joint jumps or has to turn back.
    mode
        As asked for.
    mean, best_constant, median_constant
        m/N, mean compliance at the nodes: as chosen, of the best constant turn (nan: none is feasible), and the median
        of all constant ones that are.
    """

    turn: FloatArray
    abc: FloatArray
    configuration: IntArray
    constant: bool
    changes: IntArray
    mode: str | float = BEST
    mean: float = np.nan
    best_constant: float = np.nan
    median_constant: float = np.nan

    def evaluate(
        self, model: StiffnessModel, samples: Samples, load: Load, force: float, progress: Progress | None = None
    ) -> Evaluation:
        """Evaluation along the path, in stretches of one configuration where configurations were chosen."""
        parts, chosen = [], self.mode not in (FIXED, FEED) and len(model.machine.configurations) > 1
        changes = (np.flatnonzero(np.diff(self.configuration)) + 1).tolist()
        for start, stop in pairwise([0, *changes, len(samples)]):
            there, only = samples.take(slice(start, stop)), model
            if chosen:
                only = replace(model, machine=model.machine.with_changes(only=int(self.configuration[start])))
            poses = (there.position, there.abc, there.tangent, there.tool_length)
            parts.append(evaluate(only, *poses, load, force, progress))
        return Evaluation.joined(parts)

    @property
    def sentence(self) -> str:
        """Sentence on what was chosen."""
        first, last = deg_from_rad(float(self.turn[0])), deg_from_rad(float(self.turn[-1]))
        if self.mode == FEED:
            return "the tool is turned about its axis with the feed"
        if self.constant:
            chosen = f"kept {first:.1f} deg from the program's"
        else:
            chosen = f"changed along the path from {first:.1f} to {last:.1f} deg from the program's"
        figures = f"mean compliance {nm_from_m(self.mean):.1f} nm/N at up to {NODES} places"
        if np.isfinite(self.best_constant):
            figures += (
                f"; the best constant turn has {nm_from_m(self.best_constant):.1f}, the median constant one "
                f"{nm_from_m(self.median_constant):.1f}"
            )
        return f"the turn about the tool's axis is {chosen}: {figures}"


def check_free_turn(machine: MachineTool, mode: str | float) -> None:
    """Raise `InputError` if a machine has no more joints than a cut needs, or for an unknown mode of turning."""
    if isinstance(mode, str) and mode not in (FIXED, FEED, BEST):
        raise InputError(f"--turn {mode}", expected=f"{FIXED}, {FEED}, {BEST}, or degrees")
    if len(machine.joint_names) < 6 or machine.joint_kinds.count("rotary") < 3:
        raise InputError(f"--turn {mode}: machine {machine.name} has no free rotation about the tool's axis")


def choose_turn(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray,
    load: Load,
    mode: str | float = BEST,
) -> TurnChoice:
    """Choose the turn at n poses of a path under a load.

    Parameters
    ----------
    model
        Machine and effects.
    position, abc, tangent, tool_length
        (n, 3) m, (n, 3) rad, (n, 3), (n,) m, of the path as programmed.
    load
        Whose compliance counts.
    mode
        "fixed" as programmed, "feed" with the tool's x along the feed, "best", or so many degrees, with the stiffest
        configuration.

    Raises
    ------
    InputError
        The machine has no free turn, or no turn reaches any pose.
    """
    rotation, machine = rotation_matrices(abc), model.machine
    if mode == FIXED:
        return _kept(rotation, np.zeros(len(abc)))
    check_free_turn(machine, mode)
    if mode == FEED:
        return replace(_kept(rotation, feed_turns(rotation, tangent)), mode=FEED)
    nodes = np.unique(np.linspace(0, len(abc) - 1, NODES).round().astype(np.int64))
    angles = np.array([rad_from_deg(float(mode))] if mode != BEST else TURN / TURNS * np.arange(TURNS))
    poses = (position[nodes], rotation[nodes], tangent[nodes])
    joints, cost = _candidates(model, poses, tool_length[nodes], load, angles)
    if not np.isfinite(cost).any():
        raise InputError(f"--turn {mode}: machine {machine.name} reaches no pose of the path so")
    limits = machine.joint_limits
    winds = np.array([kind == "rotary" for kind in machine.joint_kinds]) & (np.ptp(limits, axis=1) > TURN)
    constant = constant_costs(joints, cost, limits, winds, STEP)
    weight = SMOOTH * float(np.median(cost[np.isfinite(cost)]))
    configuration, number = least_costly_way(joints, cost, winds, STEP, weight, WINDOW)
    rows = np.arange(len(nodes))
    along = cost[rows, configuration, number]
    means = float(along[np.isfinite(along)].mean()), float(constant.min())
    keeps = np.isfinite(means[1]) and means[0] > (1.0 - GAIN) * means[1]
    if keeps:
        best = np.unravel_index(int(constant.argmin()), constant.shape)
        configuration, number = np.full(len(nodes), best[0]), np.full(len(nodes), best[1])
    reached = np.flatnonzero(np.isfinite(cost[rows, configuration, number]))
    path = unwound(joints[reached, configuration[reached], number[reached]], winds)
    broken = (np.diff(configuration[reached]) != 0) | (np.abs(np.diff(path, axis=0)) > STEP).any(axis=1)
    changes, begin = [], 0
    for i in range(1, len(path)):
        if broken[i - 1] or not room_to_wind(path[begin : i + 1], limits, winds):
            changes.append(int(nodes[reached[i]]))
            begin = i
    turn = np.interp(np.arange(len(abc)), nodes, np.unwrap(angles[number]))
    nearest = np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), np.arange(len(abc)))
    possible = constant[np.isfinite(constant)]
    return TurnChoice(
        turn=turn,
        abc=roll_pitch_yaw(turned_about_tool(rotation, turn)) + 0.0,
        configuration=configuration[nearest],
        constant=bool(keeps) or len(angles) == 1,
        changes=np.array(changes, dtype=np.int64),
        mode=mode,
        mean=means[1] if keeps else means[0],
        best_constant=means[1] if np.isfinite(means[1]) else np.nan,
        median_constant=float(np.median(possible)) if len(possible) else np.nan,
    )


def _kept(rotation: FloatArray, turn: FloatArray) -> TurnChoice:
    """Choice of a given turn."""
    abc = roll_pitch_yaw(turned_about_tool(rotation, turn)) + 0.0
    nothing = np.zeros(len(turn), dtype=np.int64)
    return TurnChoice(turn, abc, nothing, bool((turn == turn[:1]).all()), nothing[:0])


def _candidates(
    model: StiffnessModel,
    poses: tuple[FloatArray, FloatArray, FloatArray],
    tool_length: FloatArray,
    load: Load,
    angles: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(n, c, t, j) joint values and (n, c, t) m/N along the load, inf out of reach, of all configurations and turns."""
    position, rotation, tangent = poses
    n, t, machine = len(position), len(angles), model.machine
    every = np.repeat(np.arange(n), t)
    turned = turned_about_tool(rotation[every], np.tile(angles, n))
    joints, cost = [], []
    for configuration in range(len(machine.configurations)):
        stance = machine.solve(position[every], turned, tool_length[every], configuration)
        there = evaluate_stance(model, stance, (position[every], turned, tangent[every]), load)
        with np.errstate(divide="ignore"):
            compliance = np.where(there.reachable, 1.0 / there.stiffness, np.inf)
        joints.append(stance.joints.reshape(n, t, -1))
        cost.append(np.where(np.isnan(compliance), np.inf, compliance).reshape(n, t))
    return np.stack(joints, axis=1), np.stack(cost, axis=1)
