"""What holds for the whole suite."""

from __future__ import annotations

import os
import sys

import pytest
from hypothesis import HealthCheck, settings

# No result depends on the clock: on a busy machine examples are drawn and run slowly. The `timeout` in pyproject.toml
# ends a test that does not end by itself.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")

# Whatever the environment says, compiled modules are kept: without them each process that a test starts compiles the
# whole package again, 0.6 s, and each run rewrites the asserts of 200 modules, 10 s. It holds for collecting only, so
# that the files that tests write and load are read every time.
AS_ASKED = sys.dont_write_bytecode
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_collection_finish() -> None:
    sys.dont_write_bytecode = AS_ASKED


@pytest.fixture(scope="session", autouse=True)
def no_flushing():
    """No test outlives a power cut: a flush to the disk would only cost time, some 7 ms each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda handle: None)
        yield
