"""Offsets that differ from run to run are noise to a fit, and move no mass."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scara_ident.estimation import Estimate, ols, wls
from scara_ident.estimation.least_squares import determined_value_and_weights
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.run_offsets import beside_offsets, larger_offsets, offsets_on, rms_beside_own
from scara_ident.model.model import build_model
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, noisy, recorded_torque, recording, sines, swing, write_urdf


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R))


def zeroed_runs(robot: Robot, offset: float, seed: int = 0) -> list[Recording]:
    """Three motions, each recorded twice, every run with offsets of its own on both joints."""
    rng, made = np.random.default_rng(seed), []
    for motion in (1, 2, 3):
        for repetition in (1, 2):
            run = noisy(swing(robot, f"s{motion}_{repetition}", motion, 12.0, 200.0), rng, 0.05)
            off = offset * rng.standard_normal((2, 1))
            made.append(replace(run, effort=run.effort + off, repetition=repetition, trajectory=f"s{motion}"))
    return made


def observed(robot: Robot, offset: float, seed: int = 0) -> Observations:
    return observe(build_model(robot, "basic"), prepare(zeroed_runs(robot, offset, seed), (8.0, 8.0)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_offsets_of_runs_are_not_taken_for_gravity_and_nothing_else_seems_to_differ(robot: Robot, seed: int):
    """By least squares with one offset parameters were 190 to 350 standard deviations off, those of runs without offsets."""
    steady = wls(observed(robot, 0.0, seed))
    observations = observed(robot, 0.5, seed)
    found = wls(observations)
    bodies = [k for k, name in enumerate(found.model.names) if not name.startswith("p_o")]
    far, near = (
        np.linalg.norm(((item.value - steady.value) / steady.std)[bodies]) for item in (ols(observations), found)
    )
    assert near < 2.0 < 100.0 < far
    told = found.variation.sizes(robot)
    assert all(0.1 < told[joint]["offset"] < 1.0 for joint in robot.joints)
    assert all(size < 0.01 for kinds in told.values() for kind, size in kinds.items() if kind != "offset")


@pytest.mark.slow
def test_standard_deviations_are_those_of_runs_without_offsets_but_for_the_offset_itself(robot: Robot):
    """Of 20 draws the errors are one standard deviation, of the masses and of the mean offset of six runs."""
    errors, ratio = [], []
    for seed in range(20):
        found, steady = wls(observed(robot, 0.5, seed)), wls(observed(robot, 0.0, seed))
        truth = np.nan_to_num(urdf_values(found.model))
        gravity = [found.model.names.index(name) for name in ("mx1", "mx2", "mz2")]
        offsets = [k for k, name in enumerate(found.model.names) if name.startswith("p_o")]
        errors.append(((found.value - truth) / found.std)[[*gravity, *offsets]])
        ratio.append((found.std / steady.std)[gravity])
    assert np.all(np.abs(np.sqrt(np.mean(np.square(errors), axis=0)) - 1.0) < 0.5)
    assert np.median(ratio) < 1.5


def poses(robot: Robot, offset: float, seed: int, count: int) -> Observations:
    """Little motion about a pose of each run, so that means of runs alone tell gravity, and offsets of each run."""
    rng, made, time = np.random.default_rng(seed), [], np.arange(1600) / 200.0
    for k in range(count):
        shift, (q, v, a) = rng.uniform(-1.5, 1.5, (2, 1)), sines(rng, time, 2)
        q, v, a = shift + 0.03 * q, 0.03 * v, 0.03 * a
        torque = recorded_torque(robot, q, v, a, 2 * [(0.0, 0.0, 0.0, 0.0, 0.0)]) + offset * rng.standard_normal((2, 1))
        made.append(noisy(recording(robot, f"s{k}_1", time, q, torque), rng, 0.05))
    return observe(build_model(robot, "basic"), prepare(made, (8.0, 8.0)))


@pytest.mark.slow
def test_where_gravity_takes_up_offsets_of_runs_its_standard_deviations_know_it(robot: Robot):
    """Of 15 sets of six poses 89 % within two: by maximum likelihood 58 %, and up to 59 standard deviations in 40 sets."""
    errors = []
    for seed in range(15):
        found = wls(poses(robot, 0.05, seed, 6))
        assert found.offsets is not None
        gravity = [found.model.names.index(name) for name in ("mx1", "mx2", "mz2")]
        errors.append(((found.value - np.nan_to_num(urdf_values(found.model))) / found.std)[gravity])
    assert np.sqrt(np.mean(np.square(errors))) < 1.8
    assert np.mean(np.abs(errors) < 2.0) > 0.85


def test_a_fit_takes_up_of_offsets_what_least_squares_makes_of_each(robot: Robot):
    """One where runs are alike, the mean; nearly all parameters of the second joint's gravity, and most of the first's, of poses."""
    for seen, least, most in (
        (observed(robot, 0.5), (1.0, 1.0), (1.3, 1.3)),
        (poses(robot, 0.5, 0, 9), (3.5, 2.2), (5.0, 3.0)),
    ):
        taken = beside_offsets(seen, None).taken(ols(seen).information.inverse(), np.ones(2))
        assert np.all(taken > least)
        assert np.all(taken < most)
        ends = np.cumsum([0, *(rows.table.shape[1] for rows in seen.joints)])
        table = np.zeros((ends[-1], seen.parameters))
        for joint, rows in enumerate(seen.joints):
            table[ends[joint] : ends[joint + 1], rows.columns] = rows.table[:-1].T
        for joint, rows in enumerate(seen.joints):
            firsts = rows.starts[np.searchsorted(seen.owner, np.arange(len(seen.data.recordings) + 1))]
            offsets = np.zeros((ends[-1], len(firsts) - 1))
            constant = rows.table[list(seen.model.active[joint]).index(_offset(ols(seen), joint))]
            for run, (start, stop) in enumerate(pairwise(firsts)):
                offsets[ends[joint] + start : ends[joint] + stop, run] = constant[start:stop]
            fitted = table @ np.linalg.lstsq(table, offsets)[0]
            assert np.sum(np.sum(offsets * fitted, axis=0) / np.sum(offsets**2, axis=0)) == pytest.approx(
                taken[joint], rel=1e-6
            )
        found = wls(seen)
        rows = beside_offsets(seen, found.offsets)
        left = len(seen.data.recordings) - rows.taken(found.information.inverse(), found.weights)
        assert [item.draws for item in found.variation.joints] == pytest.approx(left, rel=0.02)


@pytest.mark.slow
def test_the_influence_of_rows_is_what_moves_the_value(robot: Robot):
    """By generalised least squares of all rows at once, with the whole covariance."""
    observations = observed(robot, 0.5)
    found = wls(observations)
    rows = beside_offsets(observations, found.offsets)
    parameters = observations.parameters
    normal, right, moved = np.zeros((parameters, parameters)), np.zeros(parameters), np.zeros((parameters, 0))
    for joint, (own, influence) in enumerate(zip(observations.joints, rows.influence.joints, strict=True)):
        item, count = found.offsets.joints[joint], own.table.shape[1]
        covariance = np.eye(count)
        for start, stop in zip(item.bounds[:-1], item.bounds[1:], strict=True):
            one = item.directions[2, start:stop] * item.std[2] / item.noise
            covariance[start:stop, start:stop] += np.outer(one, one)
        weight = np.linalg.inv(covariance) * found.weights[joint] ** 2
        wide = np.zeros((parameters, count))
        wide[own.columns] = own.table[:-1]
        normal += wide @ weight @ wide.T
        right += wide @ weight @ own.table[-1]
        moved = np.hstack([moved, wide @ weight])
        np.testing.assert_allclose(
            influence.table[:-1] * found.weights[joint] ** 2,
            (wide @ weight)[own.columns],
            atol=1e-6 * found.weights[joint] ** 2,
        )
    np.testing.assert_allclose(np.linalg.solve(normal, right), found.value, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.information.inverse(), np.linalg.inv(normal), rtol=1e-5, atol=1e-12)


def test_offsets_of_one_band_are_those_of_another(robot: Robot):
    observations = observed(robot, 0.5)
    offsets = wls(observations).offsets
    assert offsets_on(observations, None) is None
    for one, same in zip(offsets.joints, offsets_on(observations, offsets).joints, strict=True):
        np.testing.assert_array_equal(same.directions[2], one.directions[2])
        np.testing.assert_array_equal(same.bounds, one.bounds)
    narrow = observe(observations.model, observations.data.at((4.0, 4.0)))
    there, own = offsets_on(narrow, offsets), wls(narrow).offsets
    for one, other in zip(there.joints, own.joints, strict=True):
        np.testing.assert_allclose(one.std[2] / one.noise, other.std[2] / other.noise, rtol=0.2)
    value = [wls(narrow).value, determined_value_and_weights(narrow, there)[0]]
    assert np.linalg.norm((value[1] - value[0]) / wls(narrow).std) < 0.1


def test_errors_beside_own_offsets_are_those_of_runs_without(robot: Robot):
    """Of a sensor zeroed before each run the error on what is held out was its zero, ten times the noise."""
    shifted, same = observed(robot, 0.5), observed(robot, 0.0)
    found, steady = wls(shifted), wls(same)
    for item, other in zip(shifted.each, same.each, strict=True):
        for joint, (error, usual) in enumerate(zip(found.errors(item), steady.errors(other), strict=True)):
            assert error is not None and usual is not None
            assert error.rms_own_offset == pytest.approx(usual.rms, rel=0.05)
            assert usual.rms_own_offset is None
            assert error.relative is not None
            share = error.relative * error.rms_own_offset / error.rms
            assert error.beside_own_offset == (error.rms_own_offset, pytest.approx(share))
            # By its definition, with the offset as an unknown.
            rows = item.joints[joint]
            left, constant = (
                rows.left(found.value),
                rows.table[list(found.model.active[joint]).index(_offset(found, joint))],
            )
            rest = left - constant * np.linalg.lstsq(constant[:, None], left, rcond=None)[0]
            assert error.rms_own_offset == pytest.approx(np.sqrt(rest @ rest / rows.samples), rel=1e-9)
    together = rms_beside_own(found.value, shifted)
    for joint, rows in enumerate(shifted.joints):
        each = [rms_beside_own(found.value, item)[joint] ** 2 * item.joints[joint].samples for item in shifted.each]
        assert together[joint] ** 2 * rows.samples == pytest.approx(sum(each), rel=1e-9)


def _offset(found: Estimate, joint: int) -> int:
    return list(found.model.names).index(f"p_o{joint + 1}")


def test_the_larger_offsets_are_taken_joint_by_joint(robot: Robot):
    small, large = (wls(observed(robot, offset)).offsets for offset in (0.1, 0.5))
    assert small is not None and large is not None
    mixed = replace(large, joints=(large.joints[0], None))
    found = larger_offsets(small, mixed)
    assert found is not None and found.joints == (large.joints[0], small.joints[1])
    assert larger_offsets(None, large) is large and larger_offsets(small, None) is small
    assert larger_offsets(None, None) is None
