"""The seven cases with an undeclared effect, and measured arms."""

from __future__ import annotations

import json
from types import ModuleType

import numpy as np
import pytest

from scara_ident import load_robot, read_recordings
from scara_ident.diagnosis import Diagnosis, diagnose
from tests.shared import ROOT, shared_path

pytestmark = pytest.mark.slow

# How far a parameter may be off, where a share of it is not the measure.
ABSOLUTE = {"tilt_x": 0.005, "tilt_y": 0.005, "delay": 0.001}
RELATIVE = 0.15
CASES = (
    "nothing_missing",
    "transmission_loss",
    "torque_ripple",
    "base_tilt",
    "time_delay",
    "presliding_and_spring",
    "not_in_any_catalogue",
)


def run(case: str) -> Diagnosis:
    robot = load_robot()
    training = read_recordings([shared_path("cases", case, "train")], robot)
    return diagnose(robot, training, validation=read_recordings([shared_path("cases", case, "test")], robot))


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return pytest.importorskip("measured", reason="benchmarks are not part of an installed package")


@pytest.mark.parametrize("case", CASES)
def test_case_is_diagnosed_right(case: str):
    answers = json.loads(shared_path("cases", "answers.json").read_text())[case]
    result = run(case)
    found = {(effect.effect, effect.joint): effect for effect in result.effects}
    declared = [answer for answer in answers if answer["effect"] != "unexplained"]
    assert set(found) == {(answer["effect"], answer["joint"]) for answer in declared}
    for answer in declared:
        parameters = found[answer["effect"], answer["joint"]].parameters
        for name, value in answer["parameters"].items():
            assert parameters[name].value == pytest.approx(value, rel=RELATIVE, abs=ABSOLUTE.get(name, 0.0)), name
    hidden = [answer for answer in answers if answer["effect"] == "unexplained"]
    if hidden:
        assert result.verdict == "unexplained"
        assert result.unexplained is not None
        assert result.unexplained.joint == hidden[0]["joint"]
    else:
        assert result.verdict == ("explained" if declared else "complete")


def test_emps_friction_differs_by_direction():
    robot = load_robot(shared_path("data", "emps", "robot.yaml"))
    result = diagnose(
        robot,
        read_recordings([shared_path("data", "emps", "identification.parquet")], robot),
        model="basic",
        validation=read_recordings([shared_path("data", "emps", "validation_pulses.parquet")], robot),
    )

    def relative(estimate, observations) -> float:
        (error,) = estimate.errors(observations.each[0])
        return error.relative

    assert "asymmetric_friction" in {effect.effect for effect in result.effects}
    # Published: 4.08 to 3.11 %, a factor of 0.76.
    training = relative(result.after, result.training_after) / relative(result.before, result.training_before)
    assert training <= 0.82
    assert relative(result.after, result.validation_after) < relative(result.before, result.validation_before)


def test_what_is_found_on_half_of_the_ur10e_holds_on_recordings_that_nothing_saw(measured: ModuleType):
    """Gear loss of shoulder and elbow, and presliding in the wrist; none of them was published with the data.

    The other way round is in ``benchmarks/measured.py``: it takes half a minute more.
    """
    arm = shared_path("data", "ur10e")
    one, other = measured.halves(read_recordings([arm], load_robot(arm / "robot.yaml")))
    one, other = ([item for item in half if np.ptp(item.time) < 45.0] for half in (one, other))
    found = measured.direction(arm, "basic", other, one)
    ratios = {(item["effect"], item["joint"]): item["ratio"] for item in found["effects"]}
    assert {(name, joint) for name, joint in ratios if name == "transmission_loss"} == {
        ("transmission_loss", "shoulder_lift_joint"),
        ("transmission_loss", "elbow_joint"),
    }
    assert all(ratio < measured.HOLDS for ratio in ratios.values()), ratios
