"""Where a joint stands still, how its equation fades out towards that, and the filter of positions that decides both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.identification.identify import identify
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.motion import motion_of
from scara_ident.motion.position_noise import noisier
from scara_ident.motion.prepared import PreparedStretch, prepare
from scara_ident.motion.rest import FEW_SAMPLES, fading, rest_speeds, slower
from scara_ident.recording.recording import Recording
from scara_ident.recording.tables import read_arrays
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, noisy, recorded_torque, recording, sines, swing, write_urdf

RATE = 500.0
BANDS = (10.0, 10.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return swing(load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)))


def only(recording: Recording, bands: tuple[float | None, ...] = BANDS) -> PreparedStretch:
    (part,) = prepare([recording], bands).stretches
    return part


def test_a_joint_that_stops_is_left_out_there_and_no_more(run: Recording):
    position = run.position.copy()
    position[1, 2000:3000] = position[1, 2000]
    position[1, 3000:] += position[1, 2000] - position[1, 3000]
    part = only(replace(run, position=position))
    assert part.rest[1, 2100:2900].all()
    assert part.rest[1].mean() < 0.35
    assert not part.rest[0, 2100:2900].all()
    assert not part.used[1, 2100:2900].any()


def stepping(run: Recording, step: float, band: float) -> tuple[PreparedStretch, np.ndarray]:
    """Return a recording, more than half of it rest, in steps of an encoder, and where it moves at 0.7 steps per period of the filter."""
    slow = 0.7 * 3.0 * band * 2e-3
    v = np.repeat([0.0, slow, 0.0, 1.0, -1.0, 0.0], [1500, 1000, 2500, 500, 500, 2000])
    position = np.cumsum(np.vstack([v, v]), axis=1) / RATE
    position = step * np.round(position / step)
    time = np.arange(len(v)) / RATE
    made = replace(run, time=time, position=position, effort=np.zeros(position.shape), velocity=None)
    return only(made, (band, band)), np.flatnonzero(v == slow)[200:-200]


@pytest.mark.parametrize("band", [1.0, 2.0, 5.0])
def test_where_an_encoder_makes_less_than_a_step_in_a_period_of_the_filter_it_is_at_rest(run: Recording, band: float):
    """A slide that rested half of the time moved at less than that beside it: its speed went to and fro, and had a Stribeck friction."""
    part, slow = stepping(run, 2e-3, band)
    assert part.stretch.steps == pytest.approx((2e-3, 2e-3))
    # As the filtered positions have it, it goes to and fro.
    assert np.min(part.motion.v[0, slow]) < 0.0 < np.mean(part.motion.v[0, slow])
    assert part.rest[:, slow].all()
    assert not part.rest[:, 5200:5400].any()
    fine, slow = stepping(run, 2e-5, band)
    assert not fine.rest[:, slow].any()


def test_positions_with_their_noise_once_more_rest_where_they_did(run: Recording):
    part, slow = stepping(run, 2e-3, 2.0)
    data = prepare(
        [replace(run, time=part.stretch.time, position=part.stretch.position, effort=part.torque)], (2.0, 2.0)
    )
    (again,) = noisier(data).stretches
    assert again.stretch.steps == part.stretch.steps and again.rest[:, slow].all()
    (before,), (wider,) = data.stretches, noisier(data).at((4.0, 4.0)).stretches
    assert np.array_equal(again.rest, before.rest) and np.array_equal(again.fade, before.fade)
    assert np.array_equal(wider.rest, data.at((4.0, 4.0)).stretches[0].rest)


def turning(
    run: Recording, position: np.ndarray, bands: tuple[float | None, ...] = BANDS
) -> tuple[PreparedStretch, list[np.ndarray]]:
    """Return a recording of other positions, and each joint's turns at which no two samples in a row are slow."""
    time = np.arange(position.shape[1]) / RATE
    part = only(replace(run, time=time, position=position, effort=np.zeros(position.shape), velocity=None), bands)
    turns = [np.flatnonzero(np.diff(np.signbit(v))) + 1 for v in part.motion.v]
    slow = slower(part.motion.v, rest_speeds(part.stretch, part.motion, bands), RATE, bands)
    return part, [own[~rest[own]] for own, rest in zip(turns, slow, strict=True)]


def test_a_sharp_turn_is_left_out_however_fast_it_is_and_a_smooth_one_is_not(run: Recording):
    """A few turns that no sample showed to be slow left most of a wrist's residual, and were a delay and a spring to it."""
    time = np.arange(4000) / RATE
    smooth = 0.3 * np.sin(2.0 * np.pi * 0.7 * time + 0.3)
    # The acceleration is five times as large on one side of a turn as on the other.
    side = np.where(np.sin(2.0 * np.pi * 2.0 * time + 0.2) > 0.0, 5.0, 1.0)
    sharp = np.cumsum(side * np.sin(2.0 * np.pi * 2.0 * time + 0.2)) / RATE
    part, fast = turning(run, np.array([smooth, sharp]))
    assert len(fast[0]) > 5 and not part.rest[0, fast[0]].any()
    assert len(fast[1]) > 3 and part.rest[1, fast[1]].all()


def test_where_samples_are_few_every_turn_is_left_out(run: Recording):
    """One sample of the wrong sign left a UR5's joint fifty times its noise, where a period of the band had ten samples."""
    position = 0.3 * np.sin(2.0 * np.pi * (np.arange(4000) - np.array([[250.3], [250.5]])) / 1000.0)
    few = RATE / FEW_SAMPLES
    # The widest is of positions that are not filtered.
    for band, left_out in ((4.0, False), (0.99 * few, False), (1.01 * few, True), (0.2 * RATE, True)):
        part, fast = turning(run, position, (band, band))
        for joint, own in enumerate(fast):
            turns = own[(own > part.trim) & (own < part.samples - part.trim)]
            assert len(turns) > 3
            assert np.all(part.rest[joint, turns] == left_out)
        assert part.rest.mean() < 0.1


def test_the_weight_is_zero_at_rest_one_away_from_it_and_has_no_step():
    rest = np.zeros((2, 2000), dtype=bool)
    rest[0, 700:800] = rest[0, 1000:1001] = rest[0, :5] = True
    weight = fading(rest, RATE, (10.0, None))
    assert np.all(weight[0][rest[0]] == 0.0)
    assert np.all((weight[0][~rest[0]] > 0.0) & (weight[0][~rest[0]] <= 1.0))
    ramp = RATE / (3.0 * 10.0)
    assert weight[0][int(800 + ramp) + 1] == 1.0
    assert np.max(np.abs(np.diff(weight[0]))) < 2.0 / ramp
    assert np.all(weight[1] == 1.0)


def test_positions_pass_a_wider_filter_than_rows_where_the_rate_allows(run: Recording):
    part = only(run, (4.0, 8.0))
    assert part.cuts == (12.0, 24.0)
    for j, cut in enumerate(part.cuts):
        assert cut is not None
        assert_allclose(part.motion.q[j], low_pass(run.position[j], RATE, cut), atol=1e-13)
    assert only(run, (None, 0.149 * RATE)).cuts == (None, pytest.approx(0.447 * RATE))
    assert only(run, (None, 0.151 * RATE)).cuts == (None, None)


def test_where_a_joint_stands_and_breaks_away_a_narrow_filter_is_as_wide_as_leaves_what_is_at_rest_as_it_is(
    run: Recording,
):
    rng, time = np.random.default_rng(0), np.arange(8000) / RATE
    # It stands for 2 s, breaks away and goes to and fro.
    v = np.where(time > 2.0, 2.0 * np.cos(2.0 * (time - 2.0)), 0.0)
    exact = np.array([np.cumsum(v), -np.cumsum(v)]) / RATE
    cuts = []
    for noise, step in ((0.0, 0.0), (2e-5, 0.0), (2e-4, 0.0), (1e-2, 0.0), (0.0, 5e-4), (0.0, 0.1)):
        position = exact + noise * rng.standard_normal(exact.shape)
        position = position if not step else step * np.round(position / step)
        made = replace(run, time=time, position=position, effort=np.zeros(exact.shape), velocity=None)
        part = only(made, (2.0, 2.0))
        (cut, same) = part.cuts
        assert cut is not None and same == pytest.approx(cut, rel=0.1)
        cuts.append(cut)
        if 6.0 < cut < 20.0:
            # Speeds that noise or a step makes are as high as what counts as rest of any joint.
            assert rest_speeds(part.stretch, part.motion, part.bands) == pytest.approx([6e-3] * 2, rel=0.3)
    assert cuts[0] == cuts[1] == 20.0 and cuts[3] == cuts[5] == 6.0
    assert 6.0 < cuts[2] < 20.0 and 6.0 < cuts[4] <= 12.0

    turning_alone = replace(
        run, time=time, position=np.array([np.sin(2.0 * time)] * 2), effort=np.zeros(exact.shape), velocity=None
    )
    assert only(turning_alone, (2.0, 2.0)).cuts == (6.0, 6.0)


def test_a_joint_that_stands_has_no_speed_of_the_filter_that_rings(run: Recording):
    """Friction that no turn told from an offset was told by the speed of the other sign that a joint had before it broke away."""
    time = np.arange(8000) / RATE
    v = np.where((time >= 4.0) & (time < 12.0), 0.2 + 0.05 * np.sin(time), 0.0)
    made = replace(
        run, time=time, position=np.array([np.cumsum(v)] * 2) / RATE, effort=np.zeros((2, 8000)), velocity=None
    )
    part = only(made, (1.0, 1.0))
    narrow = motion_of(part.stretch, (3.0, 3.0))
    # As far as a period of the narrow one from where it sets out.
    before = (time > 3.0) & (time < 3.7)
    assert np.max(np.abs(narrow.v[0, before])) > 0.003 > 50.0 * np.max(np.abs(part.motion.v[0, before]))
    assert np.all(part.motion.v[part.used] > 0.0)


COULOMB, VISCOUS = np.array([0.1, 0.03]), np.array([0.05, 0.01])


def scara_run(seed: int, held_since: float = np.inf) -> Recording:
    """Twelve seconds of a SCARA03, audited, whose second joint is held from some time on by its servo: it trembles by 0.2 mrad."""
    robot, time = load_robot(), np.arange(3000) / 250.0
    q, v, a = sines(np.random.default_rng(seed), time, robot.n)
    late, angle = time >= held_since, 2.0 * np.pi * 1.3 * (time - min(held_since, time[-1]))
    for signal, part in zip(
        (q, v, a), (2e-4 * np.sin(angle), 1.6e-3 * np.cos(angle), -1.3e-2 * np.sin(angle)), strict=True
    ):
        signal[1, late] = part[late]
    q[1, late] += q[1, ~late][-1] if np.any(~late) else 0.3
    speed = robot.drive_sign[:, None] * v
    # It never breaks away: friction is what its servo happens to push.
    side = np.where(late & (np.arange(2) == 1)[:, None], 0.3 * np.sin(angle), np.sign(speed))
    torque = recorded_torque(robot, q, v, a, [(0.0,) * 5] * 2) + COULOMB[:, None] * side + VISCOUS[:, None] * speed
    made = noisy(recording(robot, f"run{seed}_1", time, q, torque), np.random.default_rng(seed), (0.005, 0.001))
    assert made.effort is not None
    return read_arrays(time, made.position.T, made.effort.T, robot, name=made.name)


def test_a_joint_that_is_held_all_the_while_is_at_rest_however_its_servo_trembles():
    """Of its tremor's own peak speed a share was rest, and friction was learnt of 0.2 mrad of travel."""
    still = scara_run(0, held_since=0.0)
    assert [finding.idle for finding in still.findings if finding.idle] == [(1,)]
    (part,) = prepare([still]).at((10.0, 10.0)).recordings[0].stretches
    assert not np.any(part.used[1]) and np.mean(part.used[0]) > 0.8
    # What others say of it stays what it was.
    moved = [scara_run(seed) for seed in (1, 2)]
    alone, beside = (identify(load_robot(), runs) for runs in (moved, [*moved, still]))
    own = [alone.estimate.model.names.index(name) for name in ("a02", "a12", "a22", "a32")]
    off = np.abs(beside.estimate.value - alone.estimate.value)[own] / alone.estimate.std[own]
    assert np.max(off) < 1.0


def test_a_joint_that_is_held_between_two_gaps_is_at_rest_there():
    still = replace(scara_run(0, held_since=6.0), cuts=(1500,))
    first, second = prepare([still]).at((10.0, 10.0)).recordings[0].stretches
    assert np.mean(first.used[1]) > 0.5 and not np.any(second.used[1])


def test_an_arm_of_which_a_joint_is_held_in_all_recordings_is_identified_without_it():
    runs = [scara_run(seed, held_since=0.0) for seed in (1, 2)]
    for method in ("wls", "consistent"):
        found = identify(load_robot(), runs, method=method)
        names = found.estimate.model.names
        coulomb = names.index("a01")
        assert abs(found.estimate.value[coulomb] - COULOMB[0]) < 4.0 * found.estimate.std[coulomb]
        assert found.estimate.undetermined[names.index("a02")]
