"""A torque channel that bends one way, on a joint whose load is gravity of one sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.effects import effects_named
from tests.arms import ur5
from tests.truth.scenes import formula_run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("square", [0.001, -0.0007])
def test_it_is_found_alone_and_leaves_gravity_as_it_is(square: float):
    """By a cube alone it came with a friction that depends on the position, and first moments ten standard deviations off."""
    robot = ur5()
    runs = [formula_run(robot, f"run{k}", [41, k], seconds=12.0, rate=100.0, bits=18) for k in range(3)]
    bent = []
    for run in runs:
        assert run.effort is not None
        effort = run.effort.copy()
        effort[1] += square * effort[1] ** 2
        bent.append(replace(run, effort=effort))
    catalogue = effects_named("torque_sensor_nonlinearity", "position_dependent_friction")
    found = diagnose(robot, bent, catalogue=catalogue)
    (effect,) = found.effects
    assert (effect.effect, effect.joint) == ("torque_sensor_nonlinearity", "shoulder_lift_joint")
    told = effect.parameters["square"]
    assert told.value == pytest.approx(square, abs=4.0 * told.std)
    assert told.std < 0.1 * abs(square)
    straight = diagnose(robot, runs, catalogue=catalogue)
    assert straight.effects == ()
    names = found.after.model.names
    masses = [k for k, name in enumerate(straight.after.model.names) if name.startswith("m")]
    assert masses
    for k in masses:
        place = names.index(straight.after.model.names[k])
        off = found.after.value[place] - straight.after.value[k]
        assert abs(off) < 4.0 * np.sqrt(found.after.covariance[place, place] + straight.after.covariance[k, k])
