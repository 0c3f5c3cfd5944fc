"""What holds for the whole suite."""

from __future__ import annotations

import gc
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from toolpath_stiff.arrays import FloatArray
    from toolpath_stiff.inference.evidence import Problem
    from toolpath_stiff.inference.judgement import Judgement
    from toolpath_stiff.inference.noise import Noise
    from toolpath_stiff.inference.prediction import Predictor
    from toolpath_stiff.machine.model import Hexapod
    from toolpath_stiff.readings.measurements import Readings
    from toolpath_stiff.stiffness.contract import Effect

# No result depends on the clock: on a busy machine examples are drawn and run slowly. The `timeout` in pyproject.toml
# ends a test that does not end by itself.
# 50 examples unless a test asks for more.
settings.register_profile("suite", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")

# `TPS_TEST_SEED=3 pytest ...`: what tests draw comes from another stream than the seed that they write. What the tool
# draws stays; campaigns of the rig are named by their seed, those that are only counted by `seeds`.
# An example, of which more is said than holds for most draws, keeps its stream by `as_written`.
SEED = int(os.environ.get("TPS_TEST_SEED", "0"))
as_written = np.random.default_rng
if SEED:

    def another_stream(seed: int | list[int] | None = None) -> np.random.Generator:
        drawn_by_test = sys._getframe(1).f_globals["__name__"].startswith("tests.")
        return as_written([*np.atleast_1d(seed).tolist(), SEED] if drawn_by_test else seed)

    np.random.default_rng = another_stream


def seeds(start: int, stop: int) -> range:
    """Of campaigns that a test only counts."""
    return range(start + 100_000 * SEED, stop + 100_000 * SEED)


# Whatever the environment says, compiled modules are kept: without them each process that a test starts compiles the
# whole package again, 0.6 s, and each run rewrites the asserts of 200 modules, 10 s. It holds for collecting only, so
# that the files that tests write and load are read every time.
AS_ASKED = sys.dont_write_bytecode
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# What tests and examples agree to run is recorded in a folder of theirs, also by the processes that they start.
CONFIGURATION = tempfile.TemporaryDirectory()
os.environ["XDG_CONFIG_HOME"] = CONFIGURATION.name


# Where several processes share the tests, each begins with a run of neighbours, and who is done takes half of what the
# other has left, from its end. So what is long, and what is worked out once for many tests (the site, judgements),
# stands at the beginning of such a run; what is taken at the end are many small tests. Otherwise the two processes
# build the same site, and the last waits for one long test.
LONG = (
    "tests/test_site.py",
    "tests/studio/test_studio.py",
    "tests/test_packaging.py",
    "tests/nc/test_conformance.py",
    "tests/stiffness/test_kernels.py",
    "tests/test_cluster.py",
    "tests/test_processes.py",
    "tests/test_cli_batch.py",
    "tests/test_results_folder.py",
    "tests/test_faults.py",
    "tests/test_programs.py",
    "tests/placement/",
    "tests/report/",
)
# They share judgements, and take half of the time of all: the run of another process.
TOGETHER = (
    "tests/test_cli_diagnose.py",
    "tests/test_hints.py",
    "tests/test_nist_table1.py",
    "tests/test_readme.py",
    "tests/test_tutorials.py",
    "tests/updating/",
)


def shared_out(names: Sequence[str], processes: int) -> list[int]:
    """The order of tests for so many processes: `LONG` first, `TOGETHER` where the last process begins."""
    rank = {start: number for number, start in enumerate(LONG)}
    starts = [next((start for start in LONG if name.startswith(start)), "") for name in names]
    long = sorted((i for i, start in enumerate(starts) if start), key=lambda i: rank[starts[i]])
    together = [i for i, name in enumerate(names) if name.startswith(TOGETHER)]
    small = sorted({*range(len(names))} - {*long, *together})
    last = -(-len(names) // processes)  # tests that the last process begins with
    before = max(0, len(names) - last - len(long))
    return [*long, *small[:before], *together, *small[before:]]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    processes = int(getattr(config, "workerinput", {}).get("workercount", 1))
    if processes > 1:
        items[:] = [items[i] for i in shared_out([item.nodeid for item in items], processes)]


def pytest_collection_finish() -> None:
    sys.dont_write_bytecode = AS_ASKED
    gc.freeze()  # modules and thousands of tests stay to the end: the collector need not look at them again and again


@pytest.fixture(scope="session", autouse=True)
def no_flushing():
    """No test outlives a power cut: a flush to the disk would only cost time, some 7 ms each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda handle: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def predictors_are_shared() -> Iterator[None]:
    """The nist machine's answers to campaigns of one design are worked out once a process."""
    from tests.stiffness.cases import nist
    from tests.updating.cases import predictor_for
    from toolpath_stiff.comparison import compare as comparison
    from toolpath_stiff.correction import update as ladder
    from toolpath_stiff.diagnosis import diagnose as diagnosis
    from toolpath_stiff.inference.prediction import Predictor
    from toolpath_stiff.machine.writer import machine_toml

    plain = machine_toml(nist())

    def shared(machine: Hexapod, data: Readings, effect_files: Sequence[str | Path] = ()) -> Predictor:
        """`Predictor(...)`; of the nist machine without effects of a user's own, that of the design."""
        known = not effect_files and machine_toml(machine) == plain
        return predictor_for(data) if known else Predictor(machine, data, effect_files)

    with pytest.MonkeyPatch.context() as patch:
        for module in (comparison, diagnosis, ladder):
            patch.setattr(module, "Predictor", shared)
        yield


@pytest.fixture(scope="session", autouse=True)
def joint_columns_are_shared() -> Iterator[None]:
    """What displaced joints do to readings hangs on the machine and on how they are taken: once a process for each."""
    from tests.updating.cases import joint_columns_once
    from toolpath_stiff.inference.prediction import Predictor

    of_readings = Predictor.joint_columns.func

    def for_readings(own: Predictor) -> FloatArray:
        """`Predictor.joint_columns`."""
        return joint_columns_once(own.machine, own.data, lambda: of_readings(own), own.effect_files)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Predictor, "joint_columns", property(for_readings))
        yield


@pytest.fixture(scope="session", autouse=True)
def judgements_are_shared(predictors_are_shared: None) -> Iterator[None]:
    """The same readings under the same noise are judged once a process, whichever test or command asks first.

    A test of the judgement's own repeatability begins with an empty `cases.JUDGEMENTS`.
    """
    from tests.updating import cases
    from toolpath_stiff.diagnosis import diagnose as diagnosis
    from toolpath_stiff.planning import result as planning

    def shared(problem: Problem, noise: Noise, effects: Sequence[Effect], seed: int) -> Judgement:
        """`judge(...)`, of the caller's own problem and noise."""
        return cases.judged_once(problem, noise, effects, seed)

    with pytest.MonkeyPatch.context() as patch:
        for module in (cases, diagnosis, planning):
            patch.setattr(module, "judge", shared)
        yield
