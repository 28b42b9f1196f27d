"""The same arm with the same torques goes where the recorded one went."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.motion.prepared import prepare
from scara_ident.simulation import parse_effect, simulate
from scara_ident.simulation.arm import ideal
from scara_ident.use.rollout import rollout_errors, virtual_free
from tests.simulation.made import scara, swing


def test_only_the_arm_with_the_effect_stays_by_the_recording() -> None:
    arm = ideal(scara())
    spring = parse_effect("spring:joint1:stiffness=0.5").resolve(arm)
    run = simulate(arm, swing(arm.robot, 4.0), effects=[spring])
    (part,) = prepare([run.recording], (30.0, 30.0)).stretches
    horizons = (0.05, 0.2)
    own, other = (rollout_errors(virtual_free(arm, effects), part, horizons) for effects in ([spring], []))
    assert own.shape == (2, 2)
    # What is left is the low-pass on the states that it starts from.
    assert np.all(own < 2e-4)
    assert other[1, 0] > 10.0 * own[1, 0]
    assert np.isnan(rollout_errors(virtual_free(arm, []), part, (10.0,))).all()
    # Friction that pushes takes the arm away.
    pushing = replace(arm, friction=np.array([[0.0, -60.0, 0.0, -60.0]] * 2))
    assert np.isinf(rollout_errors(virtual_free(pushing, []), part, horizons)).all()


@pytest.mark.parametrize("rate", [125.0, 50.0])
def test_at_low_rates_the_arm_stays_by_its_recording(rate: float) -> None:
    """Under twice its filter's 100 Hz a controller could not be made, and there is none in a free motion."""
    arm = ideal(scara())
    run = simulate(arm, swing(arm.robot, 4.0), rate=rate, ticks=round(1000.0 / rate))
    (part,) = prepare([run.recording], (8.0, 8.0)).stretches
    (errors,) = rollout_errors(virtual_free(arm, []), part, (0.2,))
    # Torque that is held from sample to sample comes half a sample late: by that alone 1e-3 at 125 Hz and 2.5e-3 at 50.
    assert np.all(errors < 5e-4)


def test_what_is_no_arm_astray_is_an_error() -> None:
    arm = ideal(scara())
    stiff = parse_effect("joint_elasticity:joint1:stiffness=1e15").resolve(arm)
    free = virtual_free(arm, [stiff])
    with pytest.raises(UsageError, match="so stiff"):
        free(np.zeros(2), np.zeros(2), np.zeros((2, 11)), 100.0)
