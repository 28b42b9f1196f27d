"""Settings of every test: property tests draw the same examples in every run unless told otherwise."""

from __future__ import annotations

import gc
import os

import pytest
from hypothesis import HealthCheck, settings

from tests.results import Results, made

# A run that says yes or no must say the same for the same code. To look for new counterexamples:
# HYPOTHESIS_PROFILE=explore python -m pytest
# How long an example takes is the machine's matter.
settings.register_profile("explore", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("fixed", settings.get_profile("explore"), derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


def pytest_sessionstart() -> None:
    # All that is loaded stays: it is not gone through for garbage while the rest is loaded, nor later.
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def results() -> Results:
    return made()
