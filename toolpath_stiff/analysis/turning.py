"""The free turn about the tool's axis on a machine with more joints than a cut needs: fixed, along the feed, or best.

Best are constant turns first: the one with the least mean compliance at which no pose leaves a limit. A turn that
changes along the path is taken where no constant one is feasible, or where it gains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolpath_stiff.analysis.evaluation import evaluate_stance
from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.joint_values import TURN
from toolpath_stiff.path.turning import (
    constant_costs,
    feed_turns,
    least_costly_way,
    steps_between,
    turned_about_tool,
)
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness.model import StiffnessModel

FIXED, FEED, BEST = "fixed", "feed", "best"
TURNS = 72  # of 5 degrees: compliance is smooth over the turn, and next ones differ by some tenths of a percent
NODES = 200  # poses of a path at which every turn and configuration is tried; between them the turn is interpolated
STEP = 0.35  # rad and m, most that a joint moves between two nodes; assumed, more is another way of standing there
GAIN = 0.002  # share of the mean compliance that a changing turn must save, for the joints that it moves
WINDOW = 6  # turns between two nodes
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
        Samples before which the configuration changes, or a joint jumps.
    mean, best_constant, median_constant
        m/N, mean compliance at the nodes: as chosen, of the best constant turn (nan: none is feasible), and the median
        of all constant ones that are.
    """

    turn: FloatArray
    abc: FloatArray
    configuration: IntArray
    constant: bool
    changes: IntArray
    mean: float = np.nan
    best_constant: float = np.nan
    median_constant: float = np.nan


def choose_turn(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray,
    load: Load,
    mode: str = BEST,
    turns: int = TURNS,
) -> TurnChoice:
    """The turn at n poses of a path under a load.

    Parameters
    ----------
    model
        Machine and effects.
    position, abc, tangent, tool_length
        (n, 3) m, (n, 3) rad, (n, 3), (n,) m, of the path as programmed.
    load
        Whose compliance counts.
    mode
        "fixed" as programmed, "feed" with the tool's x along the feed, "best".
    turns
        How many are tried, evenly round the circle.

    Raises
    ------
    InputError
        The machine has no free turn, or no turn reaches any pose.
    """
    rotation, machine = rotation_matrices(abc), model.machine
    if mode == FIXED:
        return _kept(rotation, np.zeros(len(abc)))
    if len(machine.joint_names) < 6 or machine.joint_kinds.count("rotary") < 3:
        raise InputError(f"--turn {mode}: machine {machine.name} has no turn about the tool's axis to spare")
    if mode == FEED:
        return _kept(rotation, feed_turns(rotation, tangent))
    nodes = np.unique(np.linspace(0, len(abc) - 1, NODES).round().astype(np.int64))
    angles = TURN / turns * np.arange(turns)
    joints, cost = _candidates(model, (position[nodes], rotation[nodes], tangent[nodes]), tool_length[nodes], load, angles)
    if not np.isfinite(cost).any():
        raise InputError(f"--turn best: machine {machine.name} reaches no pose of the path at any turn")
    rotary = np.array([float(kind == "rotary") for kind in machine.joint_kinds])
    largest = np.full((len(nodes) - 1, len(rotary)), STEP)
    constant = constant_costs(joints, cost, rotary, largest)
    weight = SMOOTH * float(np.median(cost[np.isfinite(cost)]))
    configuration, number = least_costly_way(joints, cost, rotary, largest, weight, WINDOW)
    rows = np.arange(len(nodes))
    along = cost[rows, configuration, number]
    reached = np.isfinite(along)
    means = float(along[reached].mean()), float(constant.min())
    keeps = np.isfinite(means[1]) and means[0] > (1.0 - GAIN) * means[1]
    if keeps:
        best = np.unravel_index(int(constant.argmin()), constant.shape)
        configuration, number = np.full(len(nodes), best[0]), np.full(len(nodes), best[1])
    steps = np.abs(steps_between(joints[rows, configuration, number], rotary))
    broken = np.flatnonzero((np.diff(configuration) != 0) | (steps > STEP).any(axis=1))
    turn = np.interp(np.arange(len(abc)), nodes, np.unwrap(angles[number]))
    nearest = np.abs(np.arange(len(abc))[:, None] - nodes).argmin(axis=1) if len(abc) <= NODES else np.searchsorted(
        0.5 * (nodes[1:] + nodes[:-1]), np.arange(len(abc))
    )
    possible = constant[np.isfinite(constant)]
    return TurnChoice(
        turn=turn,
        abc=roll_pitch_yaw(turned_about_tool(rotation, turn)),
        configuration=configuration[nearest],
        constant=bool(keeps),
        changes=nodes[broken + 1],
        mean=means[1] if keeps else means[0],
        best_constant=means[1] if np.isfinite(means[1]) else np.nan,
        median_constant=float(np.median(possible)) if len(possible) else np.nan,
    )


def _kept(rotation: FloatArray, turn: FloatArray) -> TurnChoice:
    """A turn that is given."""
    abc = roll_pitch_yaw(turned_about_tool(rotation, turn))
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
