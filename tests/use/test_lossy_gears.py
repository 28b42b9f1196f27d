"""The torque that lossy gears pass on, against the law of their loss the other way round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import EffectTerm, Member, Scene, Signals
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.position import Spring
from scara_ident.effects.signals import ModelledEffect
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.model import TorqueModel
from scara_ident.use.external_torque import ExternalTorque, ObserverSettings, observe_recording
from scara_ident.use.lossy_gears import LossyGears, is_lossy
from tests.arms import motion, sines

SHARE, SETTINGS = 0.3, ObserverSettings(np.array([4.0, 4.0]), bandwidth=4.0)


def lossy(known: IdentifiedModel, order: int, spring: float = 0.0) -> tuple[EffectTerm, IdentifiedModel]:
    """The model with a loss in the second gear, and with a spring on that joint's link."""
    scene = Scene(known.model, known.value, 10.0, 100.0, 10.0, np.ones(2), np.ones(2), {})
    own = EffectTerm(Spring(), Member(1), scene)
    if spring:
        scene = replace(scene, link_torques=(ModelledEffect(Spring(), Member(1), (spring,)),))
    term = EffectTerm(TransmissionLoss(order), Member(1, (SHARE,)), scene)
    terms = (*known.model.terms, term, *([own] if spring else []))
    value = np.concatenate([known.value, [SHARE], [spring] if spring else []])
    return term, replace(known, model=TorqueModel("more", known.robot, terms), value=value)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "spring"), [(1, 0.0), (2, 0.0), (2, 0.03)])
def test_a_contact_is_reported_as_it_is_though_the_gear_loses_a_share_of_it_too(
    known: IdentifiedModel, order: int, spring: float
):
    term, model = lossy(known, order, spring)
    time = np.arange(4000) / 1000.0
    q, v, a = sines(np.random.default_rng(3), time, 2)
    drift = np.array([[3.0], [2.5]])
    q, v, outside = q + drift * (time - 2.0), v + drift, np.array([[0.3], [-0.4]])
    along = motion(q, v, a)
    acting = outside * (time > 2.0)
    # The motor of the second gear sees what it transmits, less what acts from outside, and the loss of that.
    signals = Signals(term.scene, along)
    load = signals.load(1) - acting[1]
    gain = np.sqrt(1.0 + SHARE**2) if order == 2 else 1.0
    assert np.min(load) < 0.0 < np.max(load)
    without = replace(model, value=np.where(np.arange(len(model.value)) == len(known.value), 0.0, model.value))
    effort = without.torque(along) - acting
    effort[1] += (gain - 1.0) * load + SHARE * np.abs(load) * signals.sign[1]
    run = observe_recording(ExternalTorque(model, SETTINGS), "x", time, q, v, effort)
    expected = outside * -np.expm1(-2.0 * np.pi * 4.0 * np.maximum(time - 2.0005, 0.0))
    off = np.abs(run.torque - expected)[:, run.settled]
    assert ExternalTorque(model, SETTINGS).left_out == ()
    # Where the load turns, the low-pass of the rotor's acceleration takes the wrong side for some milliseconds.
    assert off[0].max() < 2e-4
    assert off[1].max() < 4e-3
    # What the gear loses of the contact alone is many times as much.
    assert SHARE * abs(outside[1, 0]) > 20.0 * off[1].max()


def test_of_a_rotor_s_momentum_the_part_that_its_gear_does_not_pass_on_is_none_of_the_links(known: IdentifiedModel):
    term, _ = lossy(known, 2)
    gears = LossyGears(known.robot, [(term, np.array([SHARE]))], 25.0)
    rotor = known.robot.row_scale[1] * term.scene.armature(1)
    for _ in range(2):
        first, none = gears.update(np.array([1.0, 2.0]), np.zeros(2), np.array([0.5, 1.0]), np.array([1.0, 1.0]), 0.01)
        np.testing.assert_array_equal(none, [0.0, 0.0])
        then, lost = gears.update(np.array([1.0, 2.0]), np.zeros(2), np.array([0.9, 1.2]), np.array([1.0, 1.0]), 0.01)
        side = float(known.robot.drive_sign[1])
        share = term.effect.passes_on(term.member, np.array([SHARE]), side)
        assert share is not None
        np.testing.assert_allclose(first, [1.0, 2.0 * share])
        np.testing.assert_allclose(then, first)
        np.testing.assert_allclose(lost, [0.0, (1.0 - share) * rotor * 0.2 / 0.01])
        # All is forgotten.
        gears.reset()


def test_only_the_loss_of_a_gear_is_one(known: IdentifiedModel):
    term, model = lossy(known, 1, 0.03)
    assert [is_lossy(item, np.array([0.1])) for item in model.model.terms].count(True) == 1
    assert is_lossy(term, np.array([0.1]))
