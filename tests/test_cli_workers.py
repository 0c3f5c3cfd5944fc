"""Processes that answer for every item, also where one of them dies. The functions here run in those processes."""

from __future__ import annotations

import os
import signal
import sys
import time
from functools import partial

import pytest

from toolpath_stiff.cli.workers import THREADS, answers, job_count
from toolpath_stiff.errors import InputError


def multiplier(factor):
    return partial(multiply, factor)


def multiply(factor, item):
    if item == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "exit":
        sys.exit(7)
    if item == "threads":
        return [os.environ[name] for name in THREADS]
    return item * factor


def died(item, process, how):
    return f"{item} died in {process > 0}: {how}"


def run(items, jobs):
    found = dict(answers(items, partial(multiplier, 10), died, jobs))
    return [found[place] for place in range(len(items))]


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_every_item_is_answered_once(jobs):
    assert run([1, 2, 3], jobs) == [10, 20, 30]


def test_a_process_that_is_killed_takes_its_own_item_alone():
    found = run([1, "kill", 2, "kill", "exit", 3], 2)
    assert [found[i] for i in (0, 2, 5)] == [10, 20, 30]
    assert "ended by SIGKILL" in found[1] and "out of memory" in found[1] and found[1] == found[3]
    assert "exit code 7" in found[4]


def test_each_process_has_one_thread_for_linear_algebra():
    assert run(["threads", "threads"], 2) == [["1"] * 3] * 2


def sleeper():
    return time.sleep


def test_whoever_stops_asking_stops_the_processes():
    start = time.monotonic()
    asked = answers([0.0, 600.0, 600.0], sleeper, died, 2)
    assert next(asked)[0] == 0
    asked.close()  # as at Ctrl-C: the generator's end tells the processes to stop
    assert time.monotonic() - start < 60  # they would sleep for ten minutes


def test_jobs_are_as_asked_and_never_more_than_items():
    assert job_count(7, 3) == 3 and job_count(2, 3) == 2 and 1 <= job_count(None, 3) <= 3
    with pytest.raises(InputError):
        job_count(0, 3)
