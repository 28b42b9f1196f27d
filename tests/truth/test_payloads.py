"""A payload mounted anyhow in recordings whose names say nothing: found, sized, and told in a recording held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.diagnosis.testing.selection_step import model_with
from scara_ident.effects import Member, effects_named
from scara_ident.effects.payload import PayloadOfRecordings
from scara_ident.estimation.least_squares import wls
from scara_ident.estimation.observations import observe
from scara_ident.motion.prepared import prepare
from tests.arms import ur5
from tests.truth.scenes import formula_run, payload_torque

pytestmark = pytest.mark.slow

PAYLOAD = pin.Inertia(1.2, np.array([0.08, -0.05, 0.12]), np.diag([0.004, 0.003, 0.005]))


@pytest.mark.slow
def test_a_payload_is_found_by_torque_and_reported_in_recordings_held_out():
    """Before, groups were tried by names and order, and a payload was a point mass: a loaded recording held out stayed off."""
    robot = ur5()
    carried = payload_torque(robot, PAYLOAD)
    loaded = {1: carried, 2: carried, 5: carried}
    runs = [
        formula_run(robot, f"run_{k}", [21, k], seconds=12.0, rate=100.0, bits=18, added=loaded.get(k))
        for k in range(7)
    ]
    catalogue = effects_named("payload_change", "friction_coupling", "drive_coupling", "torque_gain_mismatch")
    found = diagnose(robot, runs[:5], validation=runs[5:], catalogue=catalogue)
    (effect,) = found.effects
    assert effect.effect == "payload_change"
    assert effect.description == "a payload in run_1, run_2 and not in the others"
    assert effect.parameters["mass"].value == pytest.approx(PAYLOAD.mass, rel=0.03)
    moments = np.array([effect.parameters[name].value for name in ("mx", "my", "mz")])
    true = PAYLOAD.mass * np.asarray(PAYLOAD.lever)
    assert np.linalg.norm(moments - true) < 0.05 * np.linalg.norm(true)
    assert any("run_5: its first third shows payload_change" in note for note in found.notes)
    assert any("run_6: its first third shows no effect" in note for note in found.notes)

    # A model that knows which recordings are loaded is no better on the recordings held out.
    family = PayloadOfRecordings()
    scene = replace(found.search.scene, start={run.name: 0.0 for run in runs})
    member = family.in_recordings(scene, Member(None), frozenset(f"run_{k}" for k in loaded))
    model = model_with(scene, [Candidate(family, member)])
    true = wls(observe(model, prepare(runs[:5], found.search.bands))).value
    for before, after in zip(found.validation_before.each, found.validation_after.each, strict=True):
        best = observe(model, before.data)
        for place, item in enumerate(after.by_joint):
            assert item.rms(found.after.value) < 1.1 * best.by_joint[place].rms(true)
        if after.name == "run_5":
            worst = before.by_joint[-1].rms(found.before.value)
            assert worst > 4.0 * best.by_joint[-1].rms(true)


@pytest.mark.slow
def test_of_a_body_taken_up_in_the_run_all_is_reported_that_shows():
    """Before, its inertia was no column, and what that left was `unexplained`."""
    robot = ur5()
    carried = payload_torque(robot, PAYLOAD)

    def taken_up(t, *state):
        return carried(t, *state) * (t >= 5.0)

    runs = [
        formula_run(robot, f"run_{k}", [22, k], seconds=12.0, rate=100.0, bits=18, added=taken_up) for k in range(4)
    ]
    found = diagnose(robot, runs[:3], validation=runs[3:], catalogue=effects_named("payload_change"))
    (effect,) = found.effects
    assert effect.parameters["mass"].value == pytest.approx(PAYLOAD.mass, rel=0.01)
    inertia = PAYLOAD.matrix()[3:, 3:]
    seen = [effect.parameters[name].value for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")]
    true = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    assert np.max(np.abs(np.subtract(seen, true))) < 0.1 * np.max(true)
