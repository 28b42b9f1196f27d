"""Rigid arms with nothing missing but their encoders' steps, and one with a lossy gear."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import example_urdf
from tests.truth.scenes import ROTORS, Added, Array, formula_run

pytestmark = pytest.mark.slow

REDUCTION, LOSS = 100.0, 0.08


@pytest.fixture(scope="module")
def ur5(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """The UR5 with its reductions and rotors stated."""
    place = tmp_path_factory.mktemp("ur5")
    urdf = example_urdf("ur5_robot.urdf")
    (place / urdf.name).write_bytes(urdf.read_bytes())
    rotors = zip(load_robot("ur5").joints, ROTORS[:, 0] / REDUCTION**2, strict=True)
    joints = {name: {"reduction": REDUCTION, "rotor_inertia": float(value)} for name, value in rotors}
    (place / "robot.yaml").write_text(yaml.safe_dump({"urdf": urdf.name, "effort_side": "joint", "joints": joints}))
    return load_robot(place / "robot.yaml")


def diagnosed(robot: Robot, bits: int, added: Added | None = None) -> Diagnosis:
    names = enumerate(("ma", "mb", "mc"))
    runs = [formula_run(robot, name, [5, k], seconds=12.0, rate=100.0, bits=bits, added=added) for k, name in names]
    return diagnose(robot, runs)


@pytest.mark.slow
@pytest.mark.parametrize("bits", [17])
def test_the_steps_of_an_encoder_are_no_elastic_joint(ur5: Robot, bits: int):
    """Commit a6cf3ca: `explained`, elastic joints: shoulder_lift 10.9 Hz and shoulder_pan 10.6 Hz; 18 bits elbow 8.2 Hz."""
    found = diagnosed(ur5, bits)
    assert not found.effects
    assert found.verdict in ("complete", "undecided")


@pytest.mark.slow
def test_a_lossy_gear_behind_encoder_steps_is_found_alone(ur5: Robot):
    """Commit a6cf3ca: loss 0.0885 +- 0.002, and two elastic joints at 10.6 and 9.9 Hz."""
    place = ur5.joints.index("shoulder_lift_joint")

    def loss(t: Array, q: Array, v: Array, a: Array, load: Array) -> Array:
        torque = np.zeros_like(q)
        torque[place] = (np.hypot(1.0, LOSS) - 1.0) * load[place] + LOSS * np.abs(load[place]) * np.sign(v[place])
        return torque

    found = diagnosed(ur5, 17, loss)
    (effect,) = found.effects
    assert (effect.effect, effect.joint) == ("transmission_loss", "shoulder_lift_joint")
    value = effect.parameters["loss_coefficient"]
    assert abs(value.value - LOSS) < 2.0 * value.std
    assert value.std < 0.1 * LOSS
