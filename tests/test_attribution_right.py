"""What of a diagnosis is right: what an arm has under another name, or for a while, is there."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def named(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return pytest.importorskip("attribution_right", reason="benchmarks are not part of an installed package")


def test_a_payload_that_is_carried_for_a_while_is_there(named: ModuleType) -> None:
    found = {"effect": "payload_change", "joint": None, "group": [], "parameters": {"mass": [2.0, 0.1]}}
    other = {**found, "effect": "spring", "joint": "joint1", "parameters": {"stiffness": [1.0, 0.1]}}
    events = [{"recording": "M1_1", "kind": "push"}, {"recording": "M2_1", "kind": "payload"}]
    one = {"true": [], "found": [found, other]}
    assert named.wrong({**one, "true_events": events}) == ["spring"]
    assert named.wrong({**one, "true_events": events[:1]}) == ["payload_change", "spring"]
    assert named.wrong(one) == ["payload_change", "spring"]
