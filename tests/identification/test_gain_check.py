"""An effort in another unit than the others' is named with its factor; masses and scales of one unit are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.estimation.observations import observe
from scara_ident.identification.gain_check import gain_said
from scara_ident.identification.identify import identify
from scara_ident.identification.usable import usable_in_bands
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import recorded_torque, recording, sines

UR5 = load_robot("ur5")
MODEL = build_model(UR5, "basic")
WRIST = "wrist_1_joint"
NOISE, RATE, SECONDS = 0.05, 200.0, 20.0


def runs(robot=UR5, factors=()) -> list[Recording]:
    """Two motions of an arm whose efforts are recorded times a factor, by joint."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    scale = np.array([dict(factors).get(joint, 1.0) for joint in UR5.joints])[:, None]
    found = []
    for k in range(2):
        random = np.random.default_rng(k)
        q, v, a = sines(random, time, robot.n)
        torque = recorded_torque(robot, q, v, a, [(3.0, 1.0, 0.0, 0.0, 0.1)] * robot.n)
        torque = torque + NOISE * random.standard_normal(torque.shape)
        found.append(recording(UR5, f"M{k}_1", time, q, scale * torque))
    return found


def said_of(recordings) -> str | None:
    data, _, _ = usable_in_bands(MODEL, recordings)
    return gain_said(observe(MODEL, data))


@pytest.mark.parametrize(("joint", "factor"), [(WRIST, 0.1), ("shoulder_pan_joint", 0.1), ("elbow_joint", 1000.0)])
def test_an_effort_in_another_unit_is_named_with_its_gain(joint, factor):
    """Of one joint in another unit than the others it was said that its torque is not explained, and no more."""
    said = said_of(runs(factors={joint: factor}))
    assert said is not None and said.startswith(f"effort is in another unit on {joint} than on the other joints: ")
    gain, _, rest = said.partition("effort_gain of roughly ")[2].partition(" instead of 1 on ")
    # The URDF's bodies stand for the arm's, rotors not among them.
    assert float(gain) == pytest.approx(1.0 / factor, rel=0.2)
    assert rest.startswith(joint) and rest.endswith("; state it in robot.yaml")


def test_a_gain_that_is_stated_is_what_it_is_compared_with():
    robot = replace(UR5, effort_gain=np.where(np.array(UR5.joints) == WRIST, 4.0, 1.0))
    model = build_model(robot, "basic")
    data, _, _ = usable_in_bands(model, runs(factors={WRIST: 0.1}))
    said = gain_said(observe(model, data))
    assert said is not None and f"instead of 4 on {WRIST}" in said
    assert 30.0 < float(said.partition("roughly ")[2].partition(" ")[0]) < 50.0


def test_efforts_of_one_unit_are_no_fault():
    assert said_of(runs()) is None
    # All in another one, which is the scale that no recording tells.
    assert said_of(runs(factors=dict.fromkeys(UR5.joints, 0.1))) is None
    # A scale that is a little off is an effect, and a sign a matter of signs.
    assert said_of(runs(factors={WRIST: 1.6})) is None
    assert said_of(runs(factors={WRIST: -1.0})) is None


def test_bodies_of_other_masses_are_no_other_unit():
    """What the URDF has wrong of a link is a parameter, which every joint agrees on."""
    heavier = UR5.model.copy()
    place = heavier.getJointId("wrist_1_joint")
    heavier.inertias[place] = type(heavier.inertias[place])(
        6.0 * heavier.inertias[place].mass, heavier.inertias[place].lever, 6.0 * heavier.inertias[place].inertia
    )
    assert said_of(runs(replace(UR5, model=heavier))) is None


def test_identify_and_diagnose_say_it():
    recordings = runs(factors={WRIST: 0.1})
    for notes in (identify(UR5, recordings, model="basic").notes, diagnose(UR5, recordings, model="basic").notes):
        assert sum(note.startswith(f"effort is in another unit on {WRIST}") for note in notes) == 1
