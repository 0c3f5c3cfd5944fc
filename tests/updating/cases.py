"""What the tests of the diagnosis share: rig campaigns, readings by hand, a hexapod solved by hand."""

from __future__ import annotations

import copy
import hashlib
import pickle
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.conftest import as_written
from tests.effects.cases import neutral_values
from tests.stiffness.cases import nist
from toolpath_stiff.diagnosis.diagnose import Diagnosis, diagnose
from toolpath_stiff.inference import judgement as inference
from toolpath_stiff.inference.candidates import testable_effects
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.judgement import Judgement, judge
from toolpath_stiff.inference.noise import Noise, noise_models
from toolpath_stiff.inference.prediction import Predictor, idle_on
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.readings.measurements import Readings, read_measurements
from toolpath_stiff.rig import case, exercise
from toolpath_stiff.rig import hidden as hidden_module
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.term_effect import TermEffect, size_parameter
from toolpath_stiff.stiffness.terms import Term

FloatArray = NDArray[np.float64]

# Seed, layout, what is hidden, its size: one of each verdict.
VERDICTS = {
    "adequate": (100, "paper", "none", None),
    "identified": (7, "paper", "weak_strut", 0.1),
    "ambiguous": (7, "paper", "spindle_compliance", 0.1),
    "unexplained": (7, "paper", "cable_drag", 0.1),
}

OPTIONAL_COLUMNS = (
    "force_N", "sd_N_per_mm", "setup", "clamp", "repeat", "point", "time_min", "tool_extension_mm", "loop",
    "temperature_C",
)  # fmt: skip


def read_text(text: str, machine: Hexapod | None = None) -> Readings:
    """Measurements from the text of a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "measurements.csv"
        file.write_text(text, encoding="utf-8")
        return read_measurements(str(file), machine or nist())


@cache
def campaign(
    seed: int,
    layout: str = "tilted",
    hidden: str = "none",
    size: float | None = None,
    nuisances: hidden_module.Nuisances | None = None,
) -> tuple[Readings, dict[str, Any]]:
    """A blind campaign on the NIST machine and its truth."""
    rows, truth = case.make_case(seed, layout=layout, hidden=hidden, size=size, noise=nuisances or 0.02)
    return read_text(exercise.csv_text(rows)), truth


@cache
def table_1() -> Readings:
    """The paper's own 42 readings."""
    return read_measurements("nist-table1", nist())


def readings_by_hand(
    stiffness: ArrayLike,
    position: ArrayLike = (0.0, 0.0, 0.0),
    direction: ArrayLike = (1.0, 0.0, 0.0),
    point: Sequence[Any] | None = None,
    clamp: Sequence[Any] | None = None,
    setup: Sequence[str] | None = None,
    minutes: ArrayLike | None = None,
    force: ArrayLike | None = None,
    sd: ArrayLike | None = None,
) -> Readings:
    """Readings (n,) in N/m, columns that are not given missing; without clampings each reading has its own."""
    n = len(np.asarray(stiffness))

    def column(value: ArrayLike | None, missing: float = np.nan) -> FloatArray:
        return np.array(np.broadcast_to(missing if value is None else np.asarray(value, dtype=float), (n,)))

    def labels(value: Sequence[Any] | None) -> NDArray[np.str_]:
        return np.array([""] * n if value is None else [str(one) for one in value])

    given = {"point": point, "clamp": clamp, "setup": setup, "time_min": minutes, "force_N": force, "sd_N_per_mm": sd}
    rows = np.broadcast_to(np.asarray(direction, dtype=float), (n, 3))
    return Readings(
        position=np.array(np.broadcast_to(np.asarray(position, dtype=float), (n, 3))),
        angles=np.zeros((n, 3)),
        direction=rows / np.linalg.norm(rows, axis=1, keepdims=True),
        stiffness=np.array(stiffness, dtype=float),
        force=column(force, 1000.0),
        sd=column(sd),
        tool_extension=np.zeros(n),
        time=column(minutes) * 60.0,
        temperature=np.full(n, np.nan),
        setup=labels(setup),
        loop=labels(None),
        repeat=labels(None),
        point=labels(range(n) if point is None else point),
        clamp=labels(range(n) if clamp is None else clamp),
        file=np.array(["by hand"] * n),
        line=np.arange(n) + 2,
        extra={},
        missing=tuple(name for name in OPTIONAL_COLUMNS if given.get(name) is None),
    )


def oblique_directions(n: int, seed: int = 0) -> FloatArray:
    """(n, 3) unit vectors."""
    found = as_written(seed).normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def orthogonal_compliance(direction: FloatArray, first: float = 0.0, second: float = 0.0) -> FloatArray:
    """(n,) m/N at the origin of `tests.stiffness.cases.orthogonal_hexapod`, by hand.

    The two struts along an axis share the load: 1 / (2 k), with k of 10, 20, 30 N/um at 1, 2, 3 m; the law's
    constants sit at 1 and 3 m and are multiplied by exp(first), exp(second).
    """
    ends = 10e6 * np.exp(first), 30e6 * np.exp(second)
    along = np.array([ends[0], 0.5 * (ends[0] + ends[1]), ends[1]])
    return np.asarray((direction**2 / (2.0 * along)).sum(axis=1))


def active(name: str, choice: dict[str, Any] | None = None, **values: float) -> ActiveEffect:
    """An effect with SI values; those not given are neutral."""
    effect = find_effect(name)
    assert {*values, *(choice or {})} <= {parameter.name for parameter in effect.parameters}
    return ActiveEffect(effect, neutral_values(effect) | (choice or {}) | values)


def simple_noise(
    n: int,
    repeat: float = 0.02,
    clamping: float = 0.0,
    strut_spread: float = 0.0,
    joint_error: float = 0.0,
    outliers: float = 0.0,
    freedom: float = np.inf,
) -> Noise:
    """Only what is asked for."""
    return Noise(
        "stated", np.full(n, repeat), clamping, strut_spread, joint_error, outliers, 4.0, freedom, "made for a test"
    )


PREDICTORS: dict[tuple[Any, ...], Predictor] = {}
DESIGN = ("position", "angles", "direction", "force", "tool_extension", "time", "temperature", "setup")


def predictor_for(data: Readings) -> Predictor:
    """The nist machine's answers to these readings; for campaigns of one design worked out once.

    All that the model says of readings depends on how they are taken, not on what they show.
    """
    design = (*(np.asarray(getattr(data, name)).tobytes() for name in DESIGN), data.missing)
    if design not in PREDICTORS:
        PREDICTORS[design] = Predictor(nist(), data)
        assert PREDICTORS[design].joint_columns.size  # kept with the predictor from now on
    found = copy.copy(PREDICTORS[design])
    idle = idle_on(found.base, data).values()
    found.data = replace(data, warnings=tuple(dict.fromkeys((*data.warnings, *idle))))
    return found


JOINT_COLUMNS: dict[bytes, FloatArray] = {}
READ_OFF = ("stiffness", "sd", "file", "line", "notes", "warnings")  # what readings show, and where that stands


def joint_columns_once(
    machine: Hexapod,
    data: Readings,
    columns: Callable[[], FloatArray],
    files: Sequence[str | Path] = (),
) -> FloatArray:
    """`columns()`, what 36 coordinates of joints do to readings: once a process for each machine and design."""
    design = [_content(getattr(data, each.name)) for each in fields(data) if each.name not in READ_OFF]
    parts = (machine_toml(machine), [Path(file).read_bytes() for file in files], design)
    key = hashlib.sha256(pickle.dumps(parts)).digest()
    if key not in JOINT_COLUMNS:
        JOINT_COLUMNS[key] = columns()
        JOINT_COLUMNS[key].flags.writeable = False
    return JOINT_COLUMNS[key]


JUDGEMENTS: dict[tuple[Any, ...], Judgement] = {}


def judged_once(problem: Problem, noise: Noise, effects: Sequence[Effect], seed: int) -> Judgement:
    """`inference.judge`; what was judged before is not judged again, wherever its readings were read."""
    predictor = problem.predictor
    known = [_content(problem.observed), machine_toml(predictor.machine), seed, *(effect.name for effect in effects)]
    known += [Path(file).read_bytes() for file in predictor.effect_files]
    for record, apart in ((predictor.data, ("file", "line", "notes", "warnings")), (noise, ())):
        known += [_content(getattr(record, each.name)) for each in fields(record) if each.name not in apart]
    if (key := tuple(known)) not in JUDGEMENTS:
        JUDGEMENTS[key] = inference.judge(problem, noise, effects, seed)
    found = JUDGEMENTS[key]
    own = {name: dict(getattr(found, name)) for name in ("gates", "fits", "probability")}
    return replace(found, problem=problem, noise=noise, **own)


def _content(value: Any) -> Any:
    """What two records must have in common to be the same."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if is_dataclass(value):
        return tuple(_content(getattr(value, each.name)) for each in fields(value))
    if isinstance(value, Mapping):
        return tuple((name, _content(one)) for name, one in value.items())
    if isinstance(value, list | tuple):
        return tuple(_content(one) for one in value)
    return value


@cache
def judged(seed: int, layout: str = "tilted", hidden: str = "none", size: float | None = None) -> Judgement:
    """The judgement of a rig campaign under the noise that the data give away or state."""
    data, _ = campaign(seed, layout, hidden, size)
    (noise,) = noise_models(data)
    problem = Problem.of(predictor_for(data), noise)
    return judge(problem, noise, testable_effects(problem.predictor)[0], seed=0)


def make_problem(machine: Hexapod, data: Readings, noise: Noise) -> tuple[Problem, FloatArray]:
    """Data, model and scatter, ready for fits; and the covariance (n, n) of ln readings."""
    problem = Problem.of(Predictor(machine, data), noise)
    return problem, dense(problem.scatter.covariance)


def correlated_covariance(own: ArrayLike, shared: ArrayLike) -> Covariance:
    """Of n readings with variances (n,) of their own, not clamped together, and shared columns (n, q)."""
    own = np.asarray(own, dtype=float)
    return Covariance(own, Groups.by(np.arange(len(own))), 0.0, np.asarray(shared, dtype=float).T)


def dense(covariance: Covariance) -> FloatArray:
    """(n, n), written out."""
    same = covariance.groups.of[:, None] == covariance.groups.of[None, :]
    return np.diag(covariance.own_variance) + covariance.common * same + covariance.shared.T @ covariance.shared


def selected(covariance: Covariance, kept: NDArray[np.bool_]) -> Covariance:
    """Of some of the readings."""
    groups = Groups.by(covariance.groups.of[kept])
    return Covariance(covariance.own_variance[kept], groups, covariance.common, covariance.shared[:, kept])


def examined(machine: Hexapod, data: Readings, **options: Any) -> Diagnosis:
    """A diagnosis without the plan of what to measure next."""
    return diagnose(machine, data, **options)


@cache
def diagnosed(seed: int, layout: str = "paper", hidden: str = "none", size: float | None = None) -> Diagnosis:
    """The whole diagnosis of a rig campaign."""
    return examined(nist(), campaign(seed, layout, hidden, size)[0])


def effect_of(term: Term) -> TermEffect:
    """A term as an effect of one parameter, `size`."""
    return TermEffect(f"term: {term.key}", [(term, size_parameter(term.action, "size", f"size of {term.key}"))])
