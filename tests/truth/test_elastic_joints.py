"""An elastic first joint from soft to stiff, clearance, and a torque sensor that bends: found, and nothing else.

`tests/effects/test_two_mass.py` has two masses by another integrator.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.diagnosis_words import sentences
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.effects.scenes import wandering

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
SECONDS, RATE = 10.0, 250.0


def virtual(*effects: str, seed: int, numbers: Sequence[int] = range(4)) -> list[Recording]:
    arm, each = virtual_arm(), [parse_effect(effect) for effect in effects]
    return [
        simulate(arm, wandering(arm, f"t{k}", 10 * seed + k, SECONDS), effects=each, seed=k, rate=RATE,
                 link_encoders=["joint1"]).recording
        for k in numbers
    ]  # fmt: skip


def diagnosed(runs: list[Recording]) -> Diagnosis:
    return diagnose(load_robot(), runs[:-1], validation=runs[-1:])


def alone(found: Diagnosis, effect: str, joint: str, name: str) -> float:
    """The value of a parameter of the only effect."""
    assert found.verdict == "explained"
    (item,) = found.effects
    assert (item.effect, item.joint) == (effect, joint)
    return item.parameters[name].value


@pytest.mark.slow
def test_a_soft_first_joint_is_found_alone_with_its_stiffness():
    """Commit a6cf3ca: `unexplained` below 5000 N m/rad."""
    stiffness = 1500.0
    found = diagnosed(virtual(f"joint_elasticity:joint1:stiffness={stiffness}", seed=1, numbers=range(1, 4)))
    assert alone(found, "joint_elasticity", "joint1", "stiffness") == pytest.approx(stiffness, rel=0.05)
    told = found.effects[0].direct["stiffness"]
    assert told.value == pytest.approx(stiffness, abs=3.0 * told.std)
    assert told.std < 0.03 * stiffness
    (entry,) = diagnosis_dict(found)["effects"]
    assert entry["direct"]["stiffness"]["value"] == told.value
    assert any("gives stiffness" in sentence and "agrees" in sentence for sentence in sentences(found))


@pytest.mark.slow
def test_a_resonance_above_the_first_band_is_looked_for_there(monkeypatch: pytest.MonkeyPatch):
    """`complete`: the band ended where the resonance of 13 Hz begins, and no grid point below was both sure and large."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    made = pytest.importorskip("elasticity", reason="benchmarks are not part of an installed package")
    runs = made.runs("joint_elasticity:joint1:stiffness=20000", 94, 12.0)
    found = diagnosed([item.recording for item in runs])
    assert alone(found, "joint_elasticity", "joint1", "stiffness") == pytest.approx(20000.0, rel=0.05)
    assert max(found.search.bands) > 13.0


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.001, 0.004])
def test_clearance_is_found_alone_with_its_width(width: float):
    """Commit a6cf3ca: `unexplained` at 4 mrad."""
    found = diagnosed(virtual(f"backlash:joint1:width={width}", seed=2))
    assert alone(found, "backlash", "joint1", "width") == pytest.approx(width, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.22, -0.22])
def test_a_sensor_that_bends_by_22_percent_at_full_torque_is_found_alone(share: float):
    """Commit a6cf3ca: `unexplained`."""
    cubic = share / float(load_robot().torque_limit[0]) ** 2
    found = diagnosed(virtual(f"torque_sensor_nonlinearity:joint1:cubic={cubic}", seed=3))
    assert alone(found, "torque_sensor_nonlinearity", "joint1", "cubic") == pytest.approx(cubic, rel=0.1)


def test_two_elastic_joints_are_both_found_with_their_stiffness():
    """Each fitted as if it were the only one, the first came out a fifth too soft by 3 % of it, or stood for both."""
    effects = ("joint_elasticity:joint1:stiffness=6000", "joint_elasticity:joint2:stiffness=1500")
    found = diagnosed(virtual(*effects, seed=3, numbers=range(1, 5)))
    told = {item.joint: item.parameters["stiffness"] for item in found.effects}
    assert [item.effect for item in found.effects] == ["joint_elasticity"] * 2
    for joint, true in (("joint1", 6000.0), ("joint2", 1500.0)):
        assert told[joint].std < 0.1 * true
        assert abs(told[joint].value - true) < 3.0 * told[joint].std
