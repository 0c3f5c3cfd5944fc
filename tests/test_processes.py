"""Processes that answer for every call, also where one of them dies. The functions here run in those processes."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from concurrent.futures import CancelledError, as_completed

import pytest
from pebble import ProcessExpired

from toolpath_stiff.defaults import THREADS
from toolpath_stiff.errors import InputError
from toolpath_stiff.processes import ProcessPool, death


def multiply(factor, item):
    if item == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "exit":
        sys.exit(7)
    if item == "threads":
        return [os.environ[name] for name in THREADS]
    if item == "fail":
        raise InputError("not a number", expected="a number", file="x.csv", line=3)
    if item == "odd":
        raise Odd(1, 2)
    return item * factor


class Odd(Exception):
    """An exception that cannot be unpickled: it wants two arguments and hands on one."""

    def __init__(self, first, second):
        super().__init__(first + second)


def run(items, jobs):
    """Answers, or what they failed with, in the order of the items."""
    with ProcessPool(jobs) as pool:
        futures = [pool.submit(multiply, 10, item=item) for item in items]
        return [future.exception() or future.result() for future in futures]


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_every_call_is_answered_once(jobs):
    assert run([1, 2, 3], jobs) == [10, 20, 30]


def test_a_process_that_is_killed_takes_its_own_call_alone():
    found = run([1, "kill", 2, "kill", "exit", 3], 2)
    assert [found[i] for i in (0, 2, 5)] == [10, 20, 30]
    assert all(type(found[i]) is ProcessExpired and found[i].pid > 0 for i in (1, 3, 4))
    assert death(found[1]) == "its process was ended by SIGKILL (out of memory?)" == death(found[3])
    assert death(found[4]) == "its process ended by itself, exit code 7"


def test_what_a_call_raises_comes_back():
    wrong, odd, fine = run(["fail", "odd", 4], 1)
    assert type(wrong) is InputError and str(wrong) == "x.csv:3: not a number; expected a number"
    assert "test_processes.py" in str(wrong.__cause__)  # where it was raised, in the other process
    assert type(odd) is RuntimeError and str(odd) == "Odd: 3"
    assert fine == 40


def test_what_cannot_be_sent_fails_alone():
    with ProcessPool(1) as pool:
        bad, good = pool.submit(lambda: 1), pool.submit(multiply, 2, 3)
        assert good.result() == 6 and bad.exception() is not None


def test_each_process_has_one_thread_for_linear_algebra():
    assert run(["threads", "threads"], 2) == [["1"] * 3] * 2


def test_the_environment_of_the_caller_is_as_before(monkeypatch):
    monkeypatch.setenv(THREADS[0], "4")
    monkeypatch.delenv(THREADS[1], raising=False)
    before = dict(os.environ)
    run([1], 1)
    with pytest.raises(ZeroDivisionError), ProcessPool(1) as pool:
        pool.submit(abs, 1).result()
        raise ZeroDivisionError
    assert dict(os.environ) == before
    first, second = ProcessPool(1), ProcessPool(1)  # two at a time, the first left first
    first.shutdown()
    assert second.submit(multiply, 1, "threads").result() == ["1"] * 3
    second.shutdown()
    second.shutdown()
    assert dict(os.environ) == before


def test_map_and_shutdown_are_those_of_any_executor():
    pool = ProcessPool(2)
    assert list(pool.map(abs, [-1, 2, -3])) == [1, 2, 3]
    left = pool.submit(abs, -4)
    pool.shutdown()
    assert left.result() == 4
    with pytest.raises(RuntimeError):
        pool.submit(abs, 1)


def test_whoever_leaves_early_stops_the_processes():
    start, threads = time.monotonic(), set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt), ProcessPool(2) as pool:
        futures = [pool.submit(time.sleep, seconds) for seconds in (0.0, 600.0, 600.0, 600.0)]
        assert next(as_completed(futures)).result() is None
        raise KeyboardInterrupt  # as at Ctrl-C
    assert time.monotonic() - start < 60  # they would sleep for ten minutes
    assert all(future.done() for future in futures)
    assert all(f.cancelled() or isinstance(f.exception(), ProcessExpired | CancelledError) for f in futures[1:])
    assert set(threading.enumerate()) <= threads
