"""What the tables of the attribution benchmark count."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return pytest.importorskip("attribution_tables", reason="benchmarks are not part of an installed package")


def item(days: list[int], **variation: float) -> dict:
    runs = [{"day": day, "held_out": False} for day in days] + [{"day": 9, "held_out": True}]
    varied = dict.fromkeys(("friction", "scale", "offset", "delay"), 0.0) | variation
    told = {"inertial": [0.5, 3.0], "friction": [1.0], "offset": []}
    return {"conditions": {"variation": varied, "runs": runs}, "true": [], "found": [], "coverage": told}


@pytest.mark.parametrize(
    ("days", "variation", "knowable"),
    [
        ([0], {}, True),
        ([0, 0], {"scale": 0.02}, False),
        ([0, 1], {"scale": 0.02}, True),
        ([0], {"friction": 0.06}, False),
        ([0, 0], {"friction": 0.06}, True),
        ([0], {"offset": 0.02, "delay": 0.005}, True),
    ],
)
def test_std_are_asked_of_what_recordings_can_know(tables: ModuleType, days, variation, knowable: bool) -> None:
    made = item(days, **variation)
    assert tables.knowable(made) == knowable
    assert tables.covered([made]) == ("66.7%" if knowable else "-")


@pytest.mark.parametrize(
    ("sizes", "limits", "above"),
    [
        ([0.6], {"elbow": 0.3}, False),
        ([0.7], {"elbow": 0.3}, True),
        ([0.7], {"elbow": None}, False),
        ([9.0], {"elbow": 1.0}, False),
        ([0.7, 0.6], {"elbow": 0.3}, False),
        ([], {"elbow": 0.3}, False),
    ],
)
def test_published_limits_are_those_of_the_joint_where_an_effect_shows(
    tables: ModuleType, sizes, limits, above
) -> None:
    made = {"true": [{}] * len(sizes), "strengths": sizes, "strongest": ["elbow"] * len(sizes), "limits": limits}
    assert tables.above_published(made) == above


def test_the_interval_of_a_share_counts_sets_and_not_parameters(tables: ModuleType) -> None:
    low, high = tables._interval([[0.0] * 30, [3.0] * 10] * 4)
    assert low < 0.6 and high > 0.85
    assert tables._interval([[0.0], [-1.0]]) == (1.0, 1.0)


def test_a_delay_is_right_that_is_what_runs_are_late_by_too(tables: ModuleType) -> None:
    delay = {"effect": "time_delay", "joint": None, "parameters": {"delay": 0.0077}}
    found = [delay | {"parameters": {"delay": [0.0107, 0.0005], "delay_M1_1": [0.0093, 0.0004]}}]
    assert tables.effect_errors({"true": [delay], "found": found, "late": 0.0106}) == pytest.approx([0.2])
    assert tables.effect_errors({"true": [delay], "found": found}) == pytest.approx([6.0])
