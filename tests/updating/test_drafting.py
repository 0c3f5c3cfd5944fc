"""A drafted effect file: read back, it is the term that it was made of; what it declares, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.updating.cases import campaign, effect_of, predictor_for
from toolpath_stiff.correction.draft import draft_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.portrait.columns import Ground
from toolpath_stiff.portrait.dictionary import dictionary_of
from toolpath_stiff.portrait.portrait import Portrait, Sized
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.catalogue import effects_from_file
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.stiffness.model import build_model, load_path
from toolpath_stiff.stiffness.term_file import entry_of
from toolpath_stiff.stiffness.terms import Term
from toolpath_stiff.stiffness.trial import all_passed, try_effect

MARKS = ("0123456789",) * 12
LINE, RAMP = (("start", -0.11), ("end", 0.17)), (("start", 0.71), ("end", 1.13))
ABOVE, BELOW = (("edge", 0.02), ("side", 1.0)), (("edge", 0.013), ("side", -1.0))
FALLING = (("power", -1.0 / 3.0), ("reference", 500.0))
STRUT = "along the struts"
HERE = ("setup", "offset", (), 'it\'s "here"')
SWUNG = ("tilt", "square", (("centre", 0.0), ("reach", 0.6)), "platform joint")
TERMS = [
    Term("table", "Y", "y", "slope", "give", at=LINE),
    Term("table", "all", "constant", "offset", "give"),
    Term("table", "radial", "radius", "square", "give", at=(("centre", 0.03), ("reach", 0.2))),
    Term("table", "tangential", "setup", "offset", "give", column="it's \"here\""),
    Term("table", "X", "x", "bump", "give", at=(("centre", -0.05), ("width", 0.08))),
    Term("table", "Z", "z", "periodic", "give", at=(("period", 0.1), ("crest", 0.82))),
    Term("table", "all", "load", "slope", "rocking", at=FALLING),
    Term("table", "tangential", "x", "threshold", "rocking", at=ABOVE),
    Term("tool", "radial", "tilt", "slope", "give", at=(("start", 0.01), ("end", 0.2))),
    Term("tool", "axial", "tilt", "threshold", "give", at=ABOVE, column="X"),
    Term("platform", "all", "time", "slope", "give", at=(("start", 0.0), ("end", 1800.0))),
    Term("platform", "X", "y", "threshold", "tilting", at=BELOW),
    Term("frame", "radial", "constant", "offset", "vertex", where=2),
    Term("frame", "tangential", "y", "slope", "vertex", at=LINE),
    Term("frame", "Z", "temperature", "slope", "vertex", where=1, at=(("start", 18.0), ("end", 24.0))),
    Term("frame", STRUT, "x", "threshold", "vertex", at=BELOW),
    Term("platform", "axial", "z", "slope", "vertex", where=3, at=RAMP),
    Term("joints", STRUT, "strut force", "slope", "strut", at=FALLING),
    Term("struts", STRUT, "strut length", "slope", "strut factor", at=(("start", 2.5), ("end", 3.2))),
    Term("one strut", STRUT, "force sign", "sign", "strut factor", where=5, at=(("side", -1.0),)),
    Term("one strut", STRUT, "temperature", "slope", "strut factor", where=3, at=(("start", 20.0), ("end", 25.0))),
    Term("one strut", STRUT, "strut length", "threshold", "strut", where=4, at=(("edge", 2.7), ("side", 1.0))),
    Term("struts", STRUT, "strut force", "threshold", "strut", at=(("edge", 150.0), ("side", -1.0))),
    Term("table", "Y", "load", "threshold", "give", at=(("from", 900.0), ("end", 3000.0))),
    Term("joints", STRUT, "load", "threshold", "strut", at=(("beyond", 500.0),)),
    Term("struts", STRUT, "z", "bump", "strut", at=(("centre", 0.9), ("width", 0.1))),
    Term("struts", STRUT, "constant", "offset", "coupling", at=(("first", 2.0), ("second", 5.0))),
    Term("frame", STRUT, "y", "slope", "coupling", at=(*LINE, ("first", 1.0), ("second", 2.0))),
    Term("joints", "X", "constant", "offset", "joint offset", where=6, column="platform"),
    Term("joints", "Z", "constant", "offset", "joint offset", where=1, column="frame"),
    Term("instrument", "X", "x", "slope", "reading factor", at=(("start", 0.0), ("end", 0.3))),
    Term("instrument", "all", "time", "slope", "reading factor", at=(("start", 0.0), ("end", 7200.0))),
    Term("instrument", "reading", "load", "slope", "reading shift", at=(("start", 0.0), ("end", 2000.0))),
    Term("table", "horizontal", "temperature", "slope", "give", at=(("start", 20.0), ("end", 21.5))),
    Term("joints", "all", "load", "slope", "turning", at=FALLING),
    Term("joints", "all", "tilt", "square", "turning", at=(("centre", 0.0), ("reach", 0.6)), column="platform joint"),
    Term("joints", "all", "constant", "offset", "turning", where=2),
    Term("joints", "radial", "constant", "offset", "platform pin"),
    Term("joints", "tangential", "strut force", "threshold", "frame pin", where=4, at=(("within", 200.0),)),
    Term("table", "horizontal", "load", "threshold", "give", at=(("beyond", 500.0),)).with_second(*HERE),
    Term("instrument", "Y", "y", "slope", "reading factor", at=LINE).with_second("load", "slope", FALLING),
    Term("joints", STRUT, "time", "slope", "strut", at=(("start", 0.0), ("end", 9.0))).with_second(*SWUNG),
    Term("one strut", STRUT, "strut length", "slope", "strut factor", 3, RAMP).with_second(*HERE),
    Term("joints", "all", "load", "slope", "turning", at=FALLING).with_second(*SWUNG),
    Term("joints", STRUT, "tilt", "slope", "strut", at=(("start", 0.1), ("end", 0.5)), column="frame joint"),
]  # fmt: skip
WORDS = "a long clause without an end, " * 5 + 'the "table" of C:\\new gives way """here"""'


def draft_of(*terms: Term) -> str:
    """The text of the file that is drafted from these terms."""
    sized = tuple(Sized(term.sized(1e-9), (0.0, 2e-9), 0.05) for term in terms)
    return draft_text(
        "missing", Portrait(sized, alike=sized[:1]), WORDS, f"Drawn from {WORDS}.", ("a", "b", "c"), MARKS
    )


def written(tmp_path, *terms: Term) -> dict[str, Effect]:
    """The effects of that file."""
    file = tmp_path / "missing.toml"
    file.write_text(draft_of(*terms), encoding="utf-8")
    return effects_from_file(file)


@pytest.fixture(scope="module")
def some_path():
    """40 poses under loads, with everything that a term may depend on."""
    rng, n = np.random.default_rng(3), 40
    position = rng.uniform((-0.2, -0.2, 0.7), (0.2, 0.2, 1.2), (n, 3))
    direction = rng.normal(size=(n, 3))
    path = load_path(
        build_model(load_machine("nist")), position, rotation_matrices(rng.uniform(-0.3, 0.3, (n, 3))), force=900.0,
        direction=direction / np.linalg.norm(direction, axis=1, keepdims=True), time=rng.uniform(0.0, 3600.0, n),
        temperature=rng.uniform(17.0, 26.0, n), setup=np.where(rng.random(n) < 0.5, "it's \"here\"", "elsewhere"),
    )  # fmt: skip
    return replace(path, force=rng.uniform(100.0, 4000.0, n), strut_forces=rng.normal(scale=400.0, size=(n, 6)))


@pytest.mark.parametrize("term", TERMS, ids=lambda term: term.key)
def test_file_and_term_give_the_same_numbers(term, some_path, tmp_path):
    compare_with_term(term, some_path, tmp_path)


def test_every_kind_of_term_that_a_portrait_may_choose_can_be_written(some_path, tmp_path):
    """One of each link, action, direction, variable and shape of the dictionary of a campaign."""
    data = campaign(7, "tilted", "none")[0]
    predictor = predictor_for(data)
    dictionary = dictionary_of(Ground(predictor, np.exp(-predictor.log_stiffness()), np.zeros(2)))
    kinds = {
        (t.action, t.variable, t.shape, bool(t.where), t.column, t.direction, *(name for name, _ in t.at)): t
        for t in dictionary.terms
        if t.acts
    }
    assert len(kinds) > 30
    for number, term in enumerate(kinds.values()):
        folder = tmp_path / str(number)
        folder.mkdir()
        compare_with_term(term, some_path, folder, acts=False)


def compare_with_term(term, some_path, tmp_path, acts=True):
    """What a drafted file adds against the term itself; `acts`: it must add something here."""
    (drafted,), own = written(tmp_path, term).values(), effect_of(term)
    parameter = drafted.parameters[0]
    size = (0.6 if acts else 0.02) * parameter.typical[1] * parameter.si
    p, q = {parameter.name: size}, {"size": size}
    for hook in ("strut_compliance", "load_compliance", "parallel_stiffness"):
        mine, theirs = (getattr(one, hook)(some_path, values) for one, values in ((drafted, p), (own, q)))
        assert (mine is None) == (theirs is None)
        if theirs is not None:
            assert np.abs(theirs).max() > 0.0 or not acts
            np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-8 * np.abs(theirs).max())
    if term.action == "joint offset":
        machine = some_path.machine
        mine, theirs = drafted.geometry(machine, p), own.geometry(machine, q)
        np.testing.assert_array_equal(mine.frame_joints, theirs.frame_joints)
        np.testing.assert_array_equal(mine.platform_joints, theirs.platform_joints)
        assert not np.array_equal(
            [mine.frame_joints, mine.platform_joints], [machine.frame_joints, machine.platform_joints]
        )
    stiffness = np.linspace(1e7, 9e7, len(some_path))
    mine, theirs = drafted.reading(stiffness, some_path, p), own.reading(stiffness, some_path, q)
    np.testing.assert_allclose(mine, theirs, rtol=1e-7)
    assert np.any(theirs != stiffness) == drafted.is_instrument or not acts
    for attribute in ("link", "needs", "load_dependent", "unknown_to_control"):
        assert getattr(drafted, attribute) == getattr(own, attribute), attribute
    theirs = own.parameters[0]
    assert (parameter.unit, parameter.si, parameter.bounds) == (theirs.unit, theirs.si, theirs.bounds)


@pytest.mark.parametrize("term", TERMS[::5], ids=lambda term: term.key)
def test_a_draft_keeps_the_contract(term, tmp_path):
    (drafted,) = written(tmp_path, term).values()
    outcomes = try_effect(drafted, load_machine("nist"))
    assert all_passed(outcomes), outcomes


def test_several_terms_are_one_effect_but_readings_and_geometry_have_their_own(tmp_path, some_path):
    terms = (TERMS[0], TERMS[0], TERMS[20])
    found = written(tmp_path, *terms)
    assert list(found) == ["missing"]
    (effect,) = found.values()
    assert [p.name for p in effect.parameters] == ["table_y", "table_y_2", "strut_3"]
    values = {p.name: p.typical[1] * p.si for p in effect.parameters}
    own = effect_of(TERMS[0])
    twice = own.load_compliance(some_path, {"size": 2.0 * values["table_y"]})
    np.testing.assert_allclose(effect.load_compliance(some_path, values), twice)
    assert effect.needs == ("temperature_C",)
    three = [TERMS[0], *(next(t for t in TERMS if t.action == action) for action in ("joint offset", "reading factor"))]
    several = written(tmp_path / "..", *three)
    assert list(several) == ["missing", "missing_geometry", "missing_reading"]
    assert all(effect.described_from == MARKS for effect in several.values())


def test_the_same_gives_the_same_bytes():
    assert draft_of(TERMS[0]) == draft_of(TERMS[0])


def test_two_terms_add_what_each_adds(some_path, tmp_path):
    pins = [term for term in TERMS if term.action in ("frame pin", "platform pin", "turning")]
    (effect,) = written(tmp_path, *pins).values()
    sizes = {p.name: p.typical[1] * p.si for p in effect.parameters}
    for hook in ("strut_compliance", "parallel_stiffness"):
        alone = [
            getattr(effect_of(term), hook)(some_path, {"size": size})
            for term, size in zip(pins, sizes.values(), strict=True)
        ]
        added = np.asarray(sum(part for part in alone if part is not None))
        rounding = 1e-12 * np.abs(added).max()  # of entries that nearly cancel
        np.testing.assert_allclose(getattr(effect, hook)(some_path, sizes), added, rtol=1e-7, atol=rounding)


def test_no_strut_loses_more_than_four_fifths_of_its_compliance(some_path):
    softer = Term("struts", STRUT, "load", "slope", "strut factor", at=(("start", 0.0), ("end", 10.0)))
    added = effect_of(softer).strut_compliance(some_path, {"size": -0.5})
    left = 1.0 + added * some_path.machine.strut_law.stiffness(some_path.struts.lengths)
    assert left.min() == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ('link = "table"', 'link = "tabel"', "link", "link = 'tabel'; expected one of instrument,"),
        ('action = "give"', 'action = "turning"', "action", "expected one of give, rocking"),
        ('along = "Y"', 'along = "axial"', "along", "expected one of X, Y, Z, horizontal"),
        ('varies_with = "y"', 'varies_with = "strut force"', "varies_with", "expected one of constant, x, y"),
        ('shape = "slope"', 'shape = "bend"', "shape", "expected one of slope, square"),
        ("start_mm", "start_m", "constants", "expected of slope: start_mm, end_mm or power, reference_mm"),
        ("-110.0", '"left"', "constants", "a number within"),
        ("bounds_nm_per_N = [0.0, 500.0]", "bounds_nm_per_N = [9.0, 500.0]", "[[effect]]", "neutral"),
        ("bounds_nm_per_N", "bounds_um_per_N", "bounds_um_per_N", "is not known"),
        ('size = "table_y"', 'size = "table y"', "[[effect]]", "letters, digits and underscores"),
        ('along = "Y"', 'along = "Y"\nwhere = 2', "where", "no `where` of give of table"),
        ('name = "term"', 'name = "weak_strut"', 'name = "weak_strut"', "expected one of term"),
        ('name = "missing"', 'name = "it is missing"', "name", "letters, digits and underscores"),
        ("[drawn_from]", "[drawn_form]", "[drawn_form]", "drawn_form"),
    ],
)
def test_an_edited_file_is_refused_with_its_line(old, new, line, message, tmp_path):
    text, file = draft_of(TERMS[0]), tmp_path / "missing.toml"
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        effects_from_file(file)
    assert message in str(caught.value)
    assert caught.value.line is not None
    assert file.read_text(encoding="utf-8").splitlines()[caught.value.line - 1].startswith(line)


def test_constants_stand_in_the_units_of_the_shop():
    assert entry_of(TERMS[0], "table_y", "the table gives way") == {
        "name": "term", "size": "table_y", "meaning": "the table gives way", "link": "table", "action": "give",
        "along": "Y", "varies_with": "y", "shape": "slope", "constants": {"start_mm": -110.0, "end_mm": 170.0},
        "bounds_nm_per_N": [0.0, 500.0], "typical_nm_per_N": [1.0, 20.0],
    }  # fmt: skip
