"""The tree of errors: what is wrong decides the class, so that a caller can catch as much as it can handle."""

from __future__ import annotations

import pickle

import pytest

import toolpath_stiff
from toolpath_stiff import errors
from toolpath_stiff.files import write_atomically
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.machine.kinematics import forward_kinematics
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.controller import read_controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.tables import Columns, parse_table

CLASSES = [value for value in vars(errors).values() if isinstance(value, type) and issubclass(value, errors.TpsError)]


def broken_machine(folder):
    parse_machine('name = "m"', file="m.toml")


def machine_without_effect(folder):
    text = '[[effect]]\nname = "no_such_effect"\n'
    nist = load_machine("nist")
    build_model(parse_machine(machine_toml(nist) + text))


def broken_controller(folder):
    (folder / "control.toml").write_text("dialect = 7\n", "utf-8")
    read_controller(folder / "control.toml")


def no_measurements(folder):
    (folder / "m.csv").write_text("x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n", "utf-8")
    read_measurements([str(folder / "m.csv")], load_machine("nist"))


def unwritable(folder):
    (folder / "file").write_text("", "utf-8")
    write_atomically(folder / "file" / "below", "text")


@pytest.mark.parametrize(
    ("kind", "go"),
    [
        (errors.InputError, lambda folder: load_machine("nits")),
        (errors.InputError, broken_machine),
        (errors.EffectError, machine_without_effect),
        (errors.EffectError, lambda folder: find_effect("weak_stru")),
        (errors.ProgramError, lambda folder: parse_program("G1 X1 X2\n", "part.nc")),
        (errors.ProgramError, broken_controller),
        (errors.InputError, lambda folder: parse_table("", "t.csv", Columns(("x_mm",)))),
        (errors.MeasurementError, no_measurements),
        (errors.InputError, unwritable),
        (errors.InputError, lambda folder: forward_kinematics(load_machine("nist"), [[0.1] * 6])),
    ],
)
def test_what_is_wrong_decides_the_class(tmp_path, kind, go):
    with pytest.raises(errors.InputError) as caught:
        go(tmp_path)
    assert type(caught.value) is kind
    assert caught.value.exit_code == 2


def test_what_a_fit_walks_away_from_is_an_input_error_and_a_fault_is_none():
    assert issubclass(errors.EffectError, errors.InputError)
    assert not issubclass(errors.EffectFault, errors.InputError)


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_error_is_public_and_says_when_it_is_raised(kind):
    assert getattr(toolpath_stiff, kind.__name__) is kind
    assert kind.__doc__ and kind.__doc__ != kind.__mro__[1].__doc__


def test_an_error_keeps_class_and_message_between_processes():
    error = errors.ProgramError("X twice", expected="one X", file="part.nc", line=3)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is errors.ProgramError
    assert str(again) == "part.nc:3: X twice; expected one X"
