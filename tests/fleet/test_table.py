"""Every quantity of every date, with standard deviations that hold from date to date."""

from __future__ import annotations

import numpy as np

from scara_ident.effects.catalogue import available_effects
from scara_ident.fleet.changes import Change
from scara_ident.fleet.table import Quantity, _beyond_noise, _change_of, quantities
from tests.fleet.made import WORN


def test_quantities_scatter_by_their_standard_deviations(histories):
    found = quantities(histories)
    healthy = [dates for arm, dates in found.items() if arm != WORN]
    names = [item.name for item in healthy[0][0]]
    assert {"P_d1", "a01", "friction of joint1", "torque scale of joint2"} <= set(names)
    scores = []
    for dates in healthy:
        values = np.array([[item.value for item in each] for each in dates])
        std = np.array([[item.std for item in each] for each in dates])
        # One motion does not tell a spring from an inertia, and an amplitude is never below zero.
        plain = [k for k, name in enumerate(names) if not name.startswith(("amplitude", "stiffness"))]
        scores.append(((values - values.mean(axis=0)) / std)[:, plain] * np.sqrt(len(dates) / (len(dates) - 1.0)))
    rms = np.sqrt(np.mean(np.concatenate(scores) ** 2))
    assert 0.6 < rms < 1.5
    friction = np.array(
        [item.std for dates in healthy for each in dates for item in each if item.name == "friction of joint1"]
    )
    # The friction of runs differs by 2 %, which is more than one run's noise.
    assert 0.008 < np.median(friction) < 0.04


def test_the_effects_parameters_stand_beside_the_models(histories):
    found = quantities(histories)["arm1"][0]
    watched = {effect.name for effect in available_effects() if effect.watched}
    shown = {name for name in watched if any(name in item.cause for item in found)}
    assert shown == watched
    loss = next(item for item in found if item.name.startswith("loss_coefficient"))
    assert abs(loss.value) < 5.0 * loss.std and loss.unit == "1" and loss.joint == "joint1"


def test_a_quantity_has_the_first_of_the_changes_of_its_cause(histories):
    cause = histories[0].causes[0]
    item = Quantity("any", cause.joint, "1", 1.0, 0.1, cause.label)
    late, early = (
        Change(cause, cause.joint, day, False, np.ones(1), np.eye(1), 1e-6) for day in ("2026-05-01", "2026-03-01")
    )
    assert _change_of(item, "2026-04-01", (late, early)) is _change_of(item, "2026-06-01", (late, early)) is early
    assert _change_of(item, "2026-02-01", (late, early)) is None


def test_scatter_is_determined_of_coefficients_as_that_of_an_amplitude_near_zero_is_less():
    random = np.random.default_rng(0)
    values = 2.0 * random.standard_normal((40, 8, 2)) + random.standard_normal((40, 8, 2))
    arms = [[{"coefficients": (value, np.ones(2))} for value in dates] for dates in values]
    np.testing.assert_allclose(np.sqrt(_beyond_noise(arms)["coefficients"]), 2.0, rtol=0.15)
    amplitudes = np.linalg.norm(values, axis=2)[:, :, None]
    alone = [[{"amplitude": (value, np.ones(1))} for value in dates] for dates in amplitudes]
    assert np.sqrt(_beyond_noise(alone)["amplitude"][0]) < 1.3
