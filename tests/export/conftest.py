"""Identified models of three arms, with and without effects, made once."""

from __future__ import annotations

from types import ModuleType

import pytest

from scara_ident.export.identified_model import IdentifiedModel
from tests.export.arms import panda, scara, ur5
from tests.export.identified import EFFECTS, identified
from tests.shared import ROOT


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, bool], IdentifiedModel]:
    """By the robot's name and whether it has effects."""
    found = {}
    for make in (scara, ur5, panda):
        robot = make(tmp_path_factory.mktemp(make.__name__))
        for effects in (False, True):
            found[make.__name__, effects] = identified(robot, EFFECTS if effects else ())
    return found


@pytest.fixture
def readers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return pytest.importorskip("export_readers", reason="benchmarks are not part of an installed package")
