"""How runs differ from date to date, by kinds."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.fleet import changes
from scara_ident.fleet.fleet import changes_of
from scara_ident.fleet.history import freedom_of
from scara_ident.fleet.runs import PARTS, joint_scatter, run_scatter
from scara_ident.fleet.words import sentences
from tests.fleet.made import WORN, quill_fleet


def covariance(variances):
    return (PARTS * variances) @ PARTS.T


def steps_of(random, truth, noise, dates=4000):
    """Differences between neighbouring dates of kinds that differ by one covariance and are told by another."""
    values = random.multivariate_normal(np.zeros(5), truth, dates) + random.multivariate_normal(
        np.zeros(5), noise, dates
    )
    steps = np.diff(values, axis=0)
    return steps, np.tile(2.0 * noise, (len(steps), 1, 1))


@pytest.mark.parametrize("shared", [0.0, 0.9, -0.5])
def test_the_parts_of_friction_differ_together_or_apart_as_they_were_drawn(shared):
    std = np.array([0.015, 0.02, 0.002, 0.3, 1e-4])
    truth = np.diag(std**2)
    truth[0, 1] = truth[1, 0] = shared * std[0] * std[1]
    found = covariance(joint_scatter(*steps_of(np.random.default_rng(0), truth, np.diag((0.3 * std) ** 2))))
    np.testing.assert_allclose(found / np.outer(std, std), truth / np.outer(std, std), atol=0.1)


def test_what_only_a_sum_tells_is_determined_in_sum():
    """A weight lifted slowly: torque scale and offset are one direction, and each alone was lost in noise in half of the fleets."""
    std, random = np.array([0.015, 0.02, 0.005, 0.02, 1e-4]), np.random.default_rng(1)
    noise = np.diag((0.1 * std) ** 2)
    apart = np.array([0.0, 0.0, 1.0, -1.0, 0.0])
    noise += 0.2**2 * np.outer(apart, apart)
    together = np.array([0.0, 0.0, 1.0, 1.0, 0.0])
    for _ in range(20):
        found = covariance(joint_scatter(*steps_of(random, np.diag(std**2), noise, 30)))
        # Thirty dates tell a standard deviation to a sixth or so.
        assert np.sqrt(together @ found @ together) > 0.6 * np.hypot(0.005, 0.02)
        # The noise of each alone is ten times what it differs by.
        assert found[2, 2] + found[3, 3] < 0.1**2


def test_what_does_nothing_differs_by_nothing_and_no_more_than_noise_is_none():
    random, std = np.random.default_rng(2), np.array([0.015, 0.02, 0.002, 0.3, 1e-4])
    steps, noise = steps_of(random, np.diag(std**2), np.diag((0.1 * std) ** 2), 400)
    noise[:, 1] = noise[:, :, 1] = np.nan
    found = covariance(joint_scatter(steps, noise))
    assert np.all(found[1] == 0.0) and np.all(found[:, 1] == 0.0)
    kept = np.array([0, 2, 3, 4])
    np.testing.assert_allclose(np.sqrt(np.diag(found))[kept], std[kept], rtol=0.15)
    assert not np.any(joint_scatter(steps, np.full_like(noise, np.nan)))
    assert not np.any(joint_scatter(0.01 * steps, 0.01 + np.zeros_like(noise) + np.diag(std**2)))


@pytest.mark.slow
def test_friction_differs_by_what_the_runs_were_made_with(histories):
    root, freedom = run_scatter(histories)
    assert freedom == freedom_of(4 * 5)
    cover = root @ root.T
    coulomb, speed, offset, delay = (np.sqrt(cover[k, k]) for k in (0, 1, 3, 4))
    # Twenty differences tell a standard deviation to a quarter or so; they were drawn together.
    assert 0.008 < coulomb < 0.04 and 0.008 < speed < 0.04
    assert cover[0, 1] > 0.5 * coulomb * speed
    assert offset < 0.003 and delay < 0.0005


@pytest.mark.slow
def test_offsets_of_an_axis_that_lifts_are_no_payload_and_what_changes_beside_them_is_found():
    """An offset of 2 % of the weight from date to date was a payload that changed."""
    assert not any(changes_of(quill_fleet(0, (0.0, 0.0, 0.0, 0.02))).values())
    found = changes_of(quill_fleet(0, (0.02, 0.03, 0.002, 0.02), gain=0.05))
    assert [arm for arm, changes in found.items() if changes] == [WORN]
    (change,) = found[WORN]
    assert change.cause.label == "torque scale of joint2" and change.since == "2026-04-15"
    np.testing.assert_allclose(change.size[0], 0.05, atol=0.005)


@pytest.mark.slow
def test_a_slow_axis_that_lifts_has_no_payload_either():
    assert not any(changes_of(quill_fleet(118, (0.02, 0.03, 0.002, 0.02), speed=0.05)).values())


@pytest.mark.slow
def test_a_payload_is_reported_in_kg_and_what_it_leaves_over_is_no_other_change(monkeypatch):
    scatter = (0.02, 0.03, 0.002, 0.02)
    fleet = quill_fleet(0, scatter, payload=5.0)
    (told,) = (sentences(found, fleet[1].scene) for found in changes_of(fleet).values() if found)
    assert told == ("Masses and inertias, as of a payload 5 kg (± 0.007) heavier since 15 April 2026",)
    both = changes_of(quill_fleet(0, scatter, payload=5.0, gain=0.05))[WORN]
    assert {change.cause.effect for change in both} == {"inertia", "torque_scale"}
    # The hundredth of it that is a ripple would be one more.
    monkeypatch.setattr(changes, "MIN_OVER_UNEXPLAINED", 0.0)
    assert len(changes_of(fleet)[WORN]) == 2


@pytest.mark.slow
def test_coulomb_and_viscous_friction_that_differ_apart_are_no_wear():
    assert not any(changes_of(quill_fleet(1, (0.03, 0.03, 0.0, 0.0))).values())
