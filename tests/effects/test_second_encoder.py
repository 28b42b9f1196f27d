"""The stiffness of a gear by an encoder behind it: from soft to stiff, and none where nothing yields or something rattles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects.parameters import Parameter
from scara_ident.effects.second_encoder import gear_stiffness
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.effects.scenes import scene_of, wandering

ARM = virtual_arm()
SCENE = scene_of(ARM.robot)


def run(*effects: str) -> Recording:
    """Of an arm with a second encoder on the first joint."""
    made = [parse_effect(item) for item in effects]
    return simulate(
        ARM, wandering(ARM, "t", 3, 12.0), effects=made, seed=3, rate=500.0, link_encoders=["joint1"]
    ).recording


def told(*recordings: Recording, joint: int = 0) -> Parameter | None:
    return gear_stiffness(SCENE, prepare(recordings, (20.0, 20.0)).recordings, joint, 0.2)


@pytest.mark.parametrize("stiffness", [2400.0, 20000.0])
def test_it_is_within_its_deviation_which_is_a_few_percent(stiffness: float):
    recording = run(f"joint_elasticity:joint1:stiffness={stiffness}")
    found = told(recording)
    assert found is not None
    assert found.unit == "N m/rad"
    assert found.std < 0.04 * stiffness
    assert found.value == pytest.approx(stiffness, abs=3.0 * found.std)
    assert told(recording, joint=1) is None
    link = recording.link_position
    assert link is not None
    # Zeros of encoders differ from run to run; a few lost samples do not matter, many do.
    moved = replace(recording, name="other", link_position=link + 0.3)
    both = told(recording, moved)
    assert both is not None and both.value == pytest.approx(found.value, rel=1e-3)
    lost = link.copy()
    lost[0, 1000:1003] = np.nan
    again = told(replace(recording, link_position=lost))
    assert again is not None and again.value == pytest.approx(found.value, rel=1e-3)
    lost[0, 1000:2000] = np.nan
    assert told(replace(recording, link_position=lost)) is None
    assert told(replace(recording, link_position=None)) is None


def test_a_gear_that_does_not_yield_has_none():
    assert told(run()) is None


def test_clearance_is_no_stiffness():
    assert told(run("backlash:joint1:width=0.004")) is None


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_what_zeros_and_speed_make_of_a_lag_does_not_make_its_stiffness_sure(share: float):
    """Of a KR 300's second gear 2.7e6 +- 3e5 N m/rad was told, and of this one 7100 +- 570 for 20000: the zeros of the encoders
    and the columns of friction span most of the lag, and of the rest torque makes less than half."""
    recording = run("joint_elasticity:joint1:stiffness=20000")
    link = recording.link_position
    assert link is not None
    size = np.std(recording.position[0] - link[0])
    uneven = link + share * size * np.sin(7.0 * recording.position)
    runs = [replace(recording, name=f"r{k}", link_position=uneven + shift) for k, shift in enumerate((0.0, 0.3))]
    found = told(*runs)
    assert found is None or found.value == pytest.approx(20000.0, abs=2.0 * found.std)
