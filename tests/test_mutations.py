"""A seeded share of `benchmarks/mutations.py`: whatever is in a file, it is read or refused with its line."""

from __future__ import annotations

import random
import sys

import pytest

from benchmarks import mutations
from benchmarks.mutations import Kind, kinds, mutated, outcome, scene
from toolpath_stiff.errors import InputError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="alarm clocks")
EACH = 30


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.name)
def test_mutated_inputs_are_read_or_refused(kind):
    chance = random.Random(kind.name)
    with scene():
        for number in range(EACH):
            content = mutated(chance.choice(kind.originals), chance)
            assert outcome(kind, content, number) in ("read", "refused"), content


def test_what_goes_wrong_is_seen(monkeypatch):
    """The hunt would find a traceback, a missing line and a loop without an end."""

    def forgets_the_line(content, number):
        raise InputError("wrong", file="x.csv")

    def loops(content, number):
        while True:
            number += 1

    monkeypatch.setattr(mutations, "PATIENCE", 0.05)
    with scene():
        assert outcome(Kind("", (), lambda content, number: 1 / 0), b"", 0).startswith("traceback: ZeroDivisionError")
        assert outcome(Kind("", (), forgets_the_line), b"", 0).startswith("no line: x.csv: wrong")
        assert outcome(Kind("", (), forgets_the_line, lines=False), b"", 0) == "refused"
        assert outcome(Kind("", (), loops), b"", 0).startswith("hang")
