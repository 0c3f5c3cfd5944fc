"""What holds for the whole suite."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

# No result depends on the clock: on a busy machine examples are drawn and run slowly. The `timeout` in pyproject.toml
# ends a test that does not end by itself.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")


@pytest.fixture(scope="session", autouse=True)
def no_flushing():
    """No test outlives a power cut: a flush to the disk would only cost time, some 7 ms each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", lambda handle: None)
        yield
