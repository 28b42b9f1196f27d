"""A fleet that was looked at in this process, and a real scheduler with worker processes."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

from scara_ident.fleet.folder import list_fleet
from scara_ident.fleet.history import History
from scara_ident.fleet.visit import look
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.fleet.made import write_fleet


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return write_fleet(tmp_path_factory.mktemp("fleet"), suffix=".parquet")


@pytest.fixture(scope="session")
def histories(folder) -> tuple[History, ...]:
    robot = load_robot()
    model, data = build_model(robot), pickle.dumps(robot)
    files, faults = list_fleet(str(folder))
    assert faults == ()
    found = []
    for arm in dict.fromkeys(file.arm for file in files):
        visits, reference = {}, None
        for file in (file for file in files if file.arm == arm):
            visit, _ = look(data, "complete", [file], reference)
            assert visit is not None
            visits[file.date], reference = visit, visit.reference
        found.append(History(arm, tuple(visits), tuple(visits.values()), model))
    return tuple(found)


@pytest.fixture(scope="session")
def cluster() -> Iterator[object]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address="localhost:0",
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    ) as found:
        yield found
