"""The order of the tests where several processes share them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import LONG, TOGETHER, shared_out

ROOT = Path(__file__).parent.parent
NAMES = [
    *(f"tests/nc/test_small.py::test_{i}" for i in range(40)),
    *(f"{start}::test_{i}" for start in TOGETHER for i in range(2)),
    *(f"{start}::test_{i}" for start in reversed(LONG) for i in range(2)),
]


@pytest.mark.parametrize("processes", [2, 3, 8])
def test_every_test_once_what_is_long_first_and_what_belongs_together_in_one_run(processes):
    order = shared_out(NAMES, processes)
    assert sorted(order) == list(range(len(NAMES)))
    found = [NAMES[i] for i in order]
    assert [name.startswith(LONG) for name in found[: 2 * len(LONG)]] == [True] * 2 * len(LONG)
    first = next(i for i, name in enumerate(found) if name.startswith(TOGETHER))
    assert found[first : first + 2 * len(TOGETHER)] == [name for name in NAMES if name.startswith(TOGETHER)]
    if processes == 2:
        assert first == len(NAMES) // 2


def test_the_names_of_the_order_are_those_of_files():
    assert [name for name in (*LONG, *TOGETHER) if not (ROOT / name).exists()] == []
