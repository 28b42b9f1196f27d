"""Settings of every test: property tests draw the same examples in every run unless told otherwise."""

from __future__ import annotations

import gc
import os

import pytest
from hypothesis import HealthCheck, settings

from scara_ident import processes, threads
from tests.results import Results, made

# A run that says yes or no must say the same for the same code. To look for new counterexamples:
# HYPOTHESIS_PROFILE=explore python -m pytest
# How long an example takes is the machine's matter.
settings.register_profile("explore", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("fixed", settings.get_profile("explore"), derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


def pytest_configure() -> None:
    """Give each of several workers a core, where they take all: more threads and processes than cores wait for each other."""
    worker, count = (os.environ.get(f"PYTEST_XDIST_WORKER{which}") for which in ("", "_COUNT"))
    if worker is None or count is None or not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if int(count) >= len(cores):
        os.sched_setaffinity(0, {cores[int(worker.removeprefix("gw")) % len(cores)]})


def pytest_sessionstart() -> None:
    # All that is loaded stays: it is not gone through for garbage while the rest is loaded, nor later.
    gc.disable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # Modules with long tests first: no worker is left with one when the others have nothing more to do.
    long = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in long)


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two threads and processes, whatever the core of this worker."""
    for module in (threads, processes):
        monkeypatch.setattr(module, "available_cores", lambda: 2)


@pytest.fixture(scope="session")
def results() -> Results:
    return made()
