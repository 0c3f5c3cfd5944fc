"""What holds for the whole suite."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# No result depends on the clock: on a busy machine examples are drawn and run slowly. The `timeout` in pyproject.toml
# ends a test that does not end by itself.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")
