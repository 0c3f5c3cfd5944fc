"""The stiffness routes against the per-pose 24 x 24 assembly and solve, and that against OpenSees."""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.stiffness import reference
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness import closed_form, compiled, core
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.stiffness.truss import TIP, platform_bars, platform_nodes

BAR_STIFFNESS = 1e12  # N/m: rigid to 5e-5, the stiffest bars that direct stiffness solves well
PLAIN_POSES, FAST_POSES = 300, 100_000
NUMPY_BAR, COMPILED_BAR, FAIRNESS_BAR = 300.0, 5000.0, 3.0
EVALUATE = "evaluate(): stiffness, margins, limits (numpy)"
EVALUATE_BAR = 100.0  # three times the closed form's bar: reach takes no more than the kernel

Method = tuple[str, int, Callable[[], object]]


def poses(n: int, tilted: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Random poses of the measured workspace; tilted ones by up to 20 degrees about each axis."""
    rng = np.random.default_rng(1)
    position = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(0.3, 1.3, n)])
    return position, rotation_matrices(np.deg2rad(rng.uniform(-20, 20, (n, 3)))) if tilted else None


def opensees_compliance(machine: Hexapod, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """The same 25-bar truss built and solved in OpenSees, three load cases."""
    ops: Any = importlib.import_module("openseespy.opensees")  # its functions are unknown to a type checker
    nodes = position + platform_nodes(machine.platform_joints) @ rotation.T
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    for i, node in enumerate(nodes):
        ops.node(i + 1, *node.tolist())
    for i, joint in enumerate(machine.frame_joints):
        ops.node(11 + i, *joint.tolist())
        ops.fix(11 + i, 1, 1, 1)
    ops.uniaxialMaterial("Elastic", 1, 1.0)
    element = 0
    for i, j in platform_bars(machine.platform_joints):
        element += 1
        length = float(np.linalg.norm(nodes[j] - nodes[i]))
        ops.element("Truss", element, i + 1, j + 1, machine.platform_bar_stiffness * length, 1)
    for i in range(6):
        element += 1
        length = float(np.linalg.norm(nodes[i] - machine.frame_joints[i]))
        area = float(machine.strut_law.stiffness(np.array(length))) * length
        ops.element("Truss", element, 11 + i, i + 1, area, 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.algorithm("Linear")
    ops.integrator("LoadControl", 1.0)
    compliance = np.empty((3, 3))
    for axis in range(3):
        ops.timeSeries("Constant", axis + 1)
        ops.pattern("Plain", axis + 1, axis + 1)
        ops.load(TIP + 1, *np.eye(3)[axis].tolist())
        if axis == 0:
            ops.analysis("Static")
        ops.analyze(1)
        compliance[axis] = ops.nodeDisp(TIP + 1)
        ops.remove("loadPattern", axis + 1)
    return compliance


def methods(tilted: bool) -> list[Method]:
    """Name, poses a call, the call. The first is the measure of the others."""
    machine = load_machine("nist")
    model = build_model(machine)
    bars = machine.with_changes(platform_bar_stiffness=BAR_STIFFNESS)
    position, rotation = poses(FAST_POSES, tilted)
    plain_rotation = rotation if rotation is not None else np.broadcast_to(np.eye(3), (FAST_POSES, 3, 3))
    kernel = closed_form.prepare(machine)
    columns = np.ascontiguousarray(position.T)
    turned = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
    direction = np.random.default_rng(2).normal(size=(FAST_POSES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    loads = np.ascontiguousarray(direction.T)
    abc = np.zeros_like(position) if rotation is None else roll_pitch_yaw(rotation)
    few = slice(0, PLAIN_POSES)

    def plain() -> None:
        for p, r in zip(position[few], plain_rotation[few], strict=True):
            reference.tip_compliance(bars, p, r)

    def opensees() -> None:
        for p, r in zip(position[few], plain_rotation[few], strict=True):
            opensees_compliance(bars, p, r)

    return [
        ("24 x 24 assembly and solve, pose by pose (numpy)", PLAIN_POSES, plain),
        ("OpenSees, model rebuilt, pose by pose", PLAIN_POSES, opensees),
        ("exact route (batched LAPACK)", FAST_POSES, lambda: core.tip_compliance(model, position, rotation)),
        (EVALUATE, FAST_POSES, lambda: evaluate(model, position, abc, direction)),
        (
            "closed form (numpy), one direction and lengths",
            FAST_POSES,
            lambda: closed_form.compliance_along_columns(kernel, columns, loads, turned),
        ),
        (
            "compiled (numba), one direction and lengths, poses last",
            FAST_POSES,
            lambda: compiled.compliance_along_columns(kernel, columns, loads, turned),
        ),
    ]


def check_agreement(tilted: bool) -> None:
    """The methods must compute the same before their speed means anything."""
    machine = load_machine("nist")
    bars = machine.with_changes(platform_bar_stiffness=BAR_STIFFNESS)
    position, rotation = poses(20, tilted)
    turns = rotation if rotation is not None else np.broadcast_to(np.eye(3), (20, 3, 3))
    fast = core.tip_compliance(build_model(machine), position, rotation)
    kernel, tip = closed_form.prepare(machine), np.ascontiguousarray(position.T)
    columns = None if rotation is None else rotation.reshape(-1, 9).T
    axes = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, 20))
    along = closed_form.compliance_along_columns(kernel, tip, axes, columns)[0]
    for i, (p, r) in enumerate(zip(position, turns, strict=True)):
        plain = reference.tip_compliance(bars, p, r)
        np.testing.assert_allclose(opensees_compliance(bars, p, r), plain, rtol=1e-6, atol=1e-14)
        np.testing.assert_allclose(fast[i], plain, rtol=1e-3, atol=1e-12)  # bars of 1e12 against rigid ones
        np.testing.assert_allclose(along[:, i], np.diag(plain), rtol=1e-3, atol=1e-12)


def measure_routes(rounds: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether every bar is cleared."""
    lines = ["| method | poses | us a pose | poses a second | times the assembly and solve | bar |"]
    lines.append("| --- | --- | ---: | ---: | ---: | --- |")
    passed = True
    for tilted in (False, True):
        check_agreement(tilted)
        table = methods(tilted)
        seconds: list[list[float]] = [[] for _ in table]
        for _, _, call in table[2:]:
            call()  # compile, fill caches
        for _ in range(rounds):
            for times, (_, n, call) in zip(seconds, table, strict=True):
                start = time.perf_counter()
                call()
                times.append((time.perf_counter() - start) / n)
        for times, (name, _, _) in zip(seconds, table, strict=True):
            ratio = statistics.median(a / b for a, b in zip(seconds[0], times, strict=True))
            bar, clears = _bar(name, ratio)
            passed &= clears
            median = statistics.median(times)
            kind = "tilted" if tilted else "vertical"
            lines.append(f"| {name} | {kind} | {1e6 * median:.4g} | {1 / median:,.0f} | {ratio:,.3g} | {bar} |")
    return lines, passed


def _bar(name: str, ratio: float) -> tuple[str, bool]:
    if name.startswith("OpenSees"):
        return _verdict(ratio <= FAIRNESS_BAR, f"at most {FAIRNESS_BAR:g} (a fair measure)")
    if name == EVALUATE:
        return _verdict(ratio >= EVALUATE_BAR, f"at least {EVALUATE_BAR:g}")
    if name.startswith("closed form"):
        return _verdict(ratio >= NUMPY_BAR, f"at least {NUMPY_BAR:g}")
    if name.startswith("compiled"):
        return _verdict(ratio >= COMPILED_BAR, f"at least {COMPILED_BAR:g}")
    return "", True


def _verdict(clears: bool, text: str) -> tuple[str, bool]:
    return (text if clears else f"{text}: NOT CLEARED"), clears
