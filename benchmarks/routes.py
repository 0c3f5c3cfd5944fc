"""The stiffness routes against the per-pose 24 x 24 assembly and solve, and that against OpenSees."""

import statistics
import time
from collections.abc import Callable

import numpy as np

from benchmarks.pages import bar, table
from tests.stiffness import opensees, reference
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness import closed_form, core
from toolpath_stiff.stiffness.model import build_model

BAR_STIFFNESS = 1e12  # N/m: rigid to 5e-5, the stiffest bars that direct stiffness solves well
PLAIN_POSES, FAST_POSES = 300, 100_000
# Times the assembly and solve; of evaluate() three times the closed form's bar: reach takes no more than the kernel.
AT_LEAST = {"evaluate()": 100.0, "closed form": 300.0}
FAIRNESS_BAR = 3.0

Method = tuple[str, int, Callable[[], object]]


def poses(n: int, tilted: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Random poses of the measured workspace; tilted ones by up to 20 degrees about each axis."""
    rng = np.random.default_rng(1)
    position = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(0.3, 1.3, n)])
    return position, rotation_matrices(np.deg2rad(rng.uniform(-20, 20, (n, 3)))) if tilted else None


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

    def rebuilt() -> None:
        for p, r in zip(position[few], plain_rotation[few], strict=True):
            opensees.compliance(bars, p, r, BAR_STIFFNESS)

    one_way = (kernel, columns, loads, turned)
    calls: dict[str, Callable[[], object]] = {
        "24 x 24 assembly and solve, pose by pose (numpy)": plain,
        "OpenSees, model rebuilt, pose by pose": rebuilt,
        "exact route (batched LAPACK)": lambda: core.tip_compliance(model, position, rotation),
        "evaluate(): stiffness, margins, limits (numpy)": lambda: evaluate(model, position, abc, direction),
        "closed form (numpy), one direction and lengths": lambda: closed_form.compliance_along_columns(*one_way),
    }
    slow = (plain, rebuilt)
    return [(name, PLAIN_POSES if call in slow else FAST_POSES, call) for name, call in calls.items()]


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
        np.testing.assert_allclose(opensees.compliance(bars, p, r, BAR_STIFFNESS), plain, rtol=1e-6, atol=1e-14)
        np.testing.assert_allclose(fast[i], plain, rtol=1e-3, atol=1e-12)  # bars of 1e12 against rigid ones
        np.testing.assert_allclose(along[:, i], np.diag(plain), rtol=1e-3, atol=1e-12)


def measure_routes(rounds: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether every bar is cleared."""
    rows, passed = [], True
    for kind in ("vertical", "tilted"):
        check_agreement(kind == "tilted")
        timed = methods(kind == "tilted")
        seconds: list[list[float]] = [[] for _ in timed]
        for _, _, call in timed[2:]:
            call()  # fill caches
        for _ in range(rounds):
            for times, (_, n, call) in zip(seconds, timed, strict=True):
                start = time.process_time()
                call()
                times.append((time.process_time() - start) / n)
        for times, (name, _, _) in zip(seconds, timed, strict=True):
            ratio = statistics.median(a / b for a, b in zip(seconds[0], times, strict=True))
            least = next((most for start, most in AT_LEAST.items() if name.startswith(start)), 0.0)
            clears, words = ratio >= least, f"at least {least:g}" if least else ""
            if name.startswith("OpenSees"):
                clears, words = ratio <= FAIRNESS_BAR, f"at most {FAIRNESS_BAR:g} (a fair measure)"
            passed &= clears
            us = 1e6 * statistics.median(times)
            rows.append((name, kind, f"{us:.4g}", f"{1e6 / us:,.0f}", f"{ratio:,.3g}", bar(clears, words)))
    heading = "method | poses | us a pose: | poses a second: | times the assembly and solve: | bar"
    return table(heading, rows), passed
