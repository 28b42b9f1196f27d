"""The observer against a first-order low-pass of the torque that acts from outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import EffectTerm
from scara_ident.effects.catalogue import available_effects
from scara_ident.effects.parameters import Member
from scara_ident.effects.signals import Scene
from scara_ident.errors import UsageError
from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.model import TorqueModel
from scara_ident.use.external_torque import ExternalTorque, ObserverSettings, observe_recording
from tests.arms import motion, sines


def _exact(known: IdentifiedModel, rate: float, outside: np.ndarray):
    """A motion of 4 s with the torque that the model needs for it and less by what pushes; no joint stands still."""
    time = np.arange(round(4.0 * rate)) / rate
    q, v, a = sines(np.random.default_rng(3), time, 2)
    drift = np.array([[3.0], [2.5]])
    q, v = q + drift * time, v + drift
    return time, q, v, known.torque(motion(q, v, a)) - outside * (time > 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [True, False])
def test_a_step_from_outside_comes_through_the_low_pass(known: IdentifiedModel, velocity: bool):
    outside = np.array([[0.3], [-0.1]])
    time, q, v, effort = _exact(known, 1000.0, outside)
    settings = ObserverSettings(np.array([4.0, 4.0]), bandwidth=4.0)
    run = observe_recording(ExternalTorque(known, settings), "x", time, q, v if velocity else None, effort)
    before = run.settled & (time < 2.0)
    assert np.abs(run.torque[:, before]).max() < (2e-5 if velocity else 4e-3)
    # It begins between two samples.
    expected = outside * -np.expm1(-2.0 * np.pi * 4.0 * np.maximum(time - 2.0005, 0.0))
    # Positions and efforts through a low-pass of 25 Hz are that much later: two of its time constants.
    late = 0.0 if velocity else 2.0 / (2.0 * np.pi * 25.0)
    expected = np.array([np.interp(time - late, time, row) for row in expected])
    np.testing.assert_allclose(run.torque[:, run.settled], expected[:, run.settled], atol=1e-4 if velocity else 0.03)


def test_any_step_is_stable_and_a_gap_begins_anew(known: IdentifiedModel):
    time, q, v, effort = _exact(known, 20.0, np.zeros((2, 1)))
    observer = ExternalTorque(known, ObserverSettings(np.ones(2), bandwidth=8.0))
    assert np.abs(observe_recording(observer, "x", time, q, v, effort).torque).max() < 0.2
    late = time + 10.0 * (time > 3.0)
    run = observe_recording(observer, "x", late, q, v, effort)
    first = int(np.argmax(time > 3.0))
    assert not run.settled[first]
    assert np.all(run.torque[:, first] == 0.0)
    with pytest.raises(UsageError, match="1 samples"):
        observe_recording(observer, "x", time[:1], q[:, :1], v[:, :1], effort[:, :1])


def test_features_are_shares_of_the_time(known: IdentifiedModel):
    observer = ExternalTorque(known, ObserverSettings(np.array([1.0, 1.0])))
    for v in (-0.9, -0.1, 0.0, 0.1, 0.9):
        observer.reset()
        for _ in range(3):
            observer.update(np.zeros(2), np.array([v, 0.0]), np.array([0.5, 0.0]), 0.1)
        assert int(np.argmax(observer.features[0, :5])) == [-0.9, -0.1, 0.0, 0.1, 0.9].index(v)
        np.testing.assert_allclose(observer.features[:, :5].sum(axis=1), 1.0)
        assert observer.features[0, 6] == pytest.approx(0.5)


def test_an_effect_of_position_is_taken_in_and_one_of_time_left_out(known: IdentifiedModel):
    scene = Scene(known.model, known.value, 10.0, 100.0, 10.0, np.ones(2), np.ones(2), {})
    families = {family.name: family for family in available_effects()}
    terms = [EffectTerm(families[name], Member(0, ()), scene) for name in ("spring", "offset_drift")]
    model = TorqueModel("more", known.robot, (*known.model.terms, *terms))
    value = np.concatenate([known.value, *(np.full(len(term.columns), 0.1) for term in terms)])
    observer = ExternalTorque(replace(known, model=model, value=value), ObserverSettings(np.ones(2)))
    assert observer.left_out == ("offset_drift",)
