"""Laws that every effect of the catalogue keeps: neutral is nothing, compliance softens, moments stiffen, keys work."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effects.cases import CATALOGUE, all_effects, model_with, neutral_values, readings
from tests.stiffness.cases import nist, random_poses
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import effects_of_elements
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.model import build_model, load_path

NIST_TEXT = (resources.files("toolpath_stiff") / "data" / "machines" / "nist.toml").read_text("utf-8")
SOFTENING = (
    "spindle_compliance",
    "platform_flexibility",
    "joint_compliance",
    "joint_clearance",
    "contact_nonlinearity",
    "weak_strut",
    "frame_compliance",
    "table_compliance",
    "setup_compliance",
)


def directions(n: int, seed: int) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def draw_values(effect: Effect, seed: int) -> dict[str, Any]:
    """Random values within typical sizes and choices, SI."""
    rng = np.random.default_rng(seed)
    values: dict[str, Any] = {}
    for p in effect.parameters:
        low, high = p.typical
        if p.kind == "text":
            values[p.name] = "riser"
        elif p.kind == "integer":
            values[p.name] = int(rng.integers(low, high, endpoint=True))
        else:
            values[p.name] = rng.uniform(low, high) * p.si
    return values


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_neutral_value_changes_nothing(name):
    position, rotation = random_poses(20, 3)
    along = directions(20, 4)
    plain = readings(model_with(), position, along, rotation, minutes=30.0)
    neutral = readings(model_with(name), position, along, rotation, minutes=30.0)
    assert np.abs(neutral / plain - 1.0).max() < 1e-12


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_typical_size_changes_something(name):
    effect = all_effects()[name]
    position, rotation = random_poses(8, 5)
    position, rotation = np.repeat(position, 3, axis=0), np.repeat(rotation, 3, axis=0)
    along = np.tile(np.eye(3), (8, 1))
    model = build_model(nist(), extra=[ActiveEffect(effect, draw_values(effect, 6))])
    changed = readings(model, position, along, rotation, minutes=5.0)
    plain = readings(model_with(), position, along, rotation)
    assert np.abs(changed / plain - 1.0).max() > 1e-5


@pytest.mark.parametrize("name", SOFTENING)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_compliance_in_the_load_path_only_softens(name, seed):
    effect = all_effects()[name]
    position, rotation = random_poses(5, seed)
    along = directions(5, seed)
    model = build_model(nist(), extra=[ActiveEffect(effect, draw_values(effect, seed))])
    softened = readings(model, position, along, rotation)
    assert (softened <= readings(model_with(), position, along, rotation) * (1 + 1e-12)).all()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), stiffness=st.floats(1.0, 2e6))
def test_joint_moments_only_stiffen(seed, stiffness):
    position, rotation = random_poses(5, seed)
    along = directions(5, seed)
    stiffened = readings(model_with("joint_moment_stiffness", stiffness=stiffness), position, along, rotation)
    assert (stiffened >= readings(model_with(), position, along, rotation) * (1 - 1e-12)).all()


@pytest.mark.parametrize("name", CATALOGUE)
def test_compliance_tensors_stay_symmetric_and_positive(name):
    effect = all_effects()[name]
    position, rotation = random_poses(10, 7)
    model = build_model(nist(), extra=[ActiveEffect(effect, draw_values(effect, 8))])
    tensor = exact.tip_compliance(model, load_path(model, position, rotation))
    assert np.linalg.eigvalsh(tensor).min() > 0.0
    if not effect.load_dependent:
        for matrix in exact.assemble_links(model, load_path(model, position, rotation)):
            if matrix is not None:
                assert np.abs(matrix - np.swapaxes(matrix, 1, 2)).max() <= 1e-12 * np.abs(matrix).max()


@pytest.mark.parametrize("name", CATALOGUE)
def test_machine_files_carry_it_in_the_shops_units(name):
    """Values of a machine file arrive as SI: a unit's key and the same number times its SI value agree."""
    effect = all_effects()[name]
    kind = "instrument" if effect.is_instrument else "effect"
    lines = [f"[[{kind}]]", f'name = "{name}"']
    for p in effect.parameters:
        lines.append(f'{p.key} = "riser"' if p.kind == "text" else f"{p.key} = {p.typical[1]!r}")
    model = build_model(parse_machine(NIST_TEXT + "\n" + "\n".join(lines), "mine.toml"))
    active = (*model.effects, *model.instruments)[0]
    expected = {p.name: "riser" if p.kind == "text" else p.typical[1] * p.si for p in effect.parameters}
    assert active.effect.name == name
    assert active.values == expected


@pytest.mark.parametrize(
    ("name", "lines", "message"),
    [
        ("weak_strut", "strut = 7\nfactor = 0.5", "strut = 7; expected a whole number from 1 to 6"),
        ("weak_strut", "strut = 1.5\nfactor = 0.5", "strut = 1.5; expected a whole number"),
        ("weak_strut", "strut = true\nfactor = 0.5", "strut = True; expected a whole number"),
        ("weak_strut", "strut = 1\nfactor = 0.2", "factor = 0.2; expected a number from 0.3 to 1"),
        ("setup_compliance", "setup = 3\nx_nm_per_N = 1\ny_nm_per_N = 1\nz_nm_per_N = 1", "a name in quotes"),
        ("frame_compliance", "vertex = 4\nradial_nm_per_N = 1\nvertical_nm_per_N = 1", "from 0 to 3"),
        ("joint_compliance", "compliance_nm_per_N = -1", "from 0 to 200 nm/N"),
    ],
)
def test_wrong_values_are_named(name, lines, message):
    with pytest.raises(InputError, match="expected") as caught:
        build_model(parse_machine(f'{NIST_TEXT}\n[[effect]]\nname = "{name}"\n{lines}', "mine.toml"))
    assert message in str(caught.value)


def test_bounds_are_as_wide_as_promised():
    effects = all_effects()

    def bounds(name: str, parameter: str) -> tuple[float, float]:
        return next(p.bounds for p in effects[name].parameters if p.name == parameter)

    assert bounds("gauge_scale", "scale") == (-20.0, 20.0)
    assert bounds("tool_length_error", "error") == (-60.0, 60.0)
    assert bounds("joint_moment_stiffness", "stiffness")[1] >= 2e6
    assert bounds("weak_strut", "factor")[0] <= 0.3
    assert bounds("platform_flexibility", "bar_stiffness")[0] <= 1e8


def test_choices_are_never_fitted():
    chosen = {(n, p.name) for n, e in all_effects().items() for p in e.parameters if p.discrete}
    assert chosen == {
        ("weak_strut", "strut"),
        ("frame_compliance", "vertex"),
        ("joint_moment_stiffness", "strut"),
        ("setup_compliance", "setup"),
        ("gauge_scale", "direction"),
        ("gauge_scale", "setup"),
        ("joint_offset", "joint"),
    }
    assert all("riser" in neutral_values(e).values() for n, e in all_effects().items() if (n, "setup") in chosen)


def test_the_catalogue_page_lists_every_effect_parameter_and_bound():
    page = (Path(__file__).parents[2] / "docs" / "effects_catalogue.md").read_text("utf-8")
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| [`")}
    every = {**all_effects(), **effects_of_elements()}
    assert set(rows) == set(every)
    for name, effect in every.items():
        assert rows[name].split(" | ")[1] == effect.link
        for p in effect.parameters:
            low, high = (f"{bound:g}".replace("e+0", "e") for bound in p.bounds)
            bounds = "a name" if p.kind == "text" else f"{low} to {high}"
            assert f"`{p.key}` {bounds}" in rows[name]
