"""Recordings within a band: what is filtered, kept, left out and cut into blocks, and that nothing is made twice."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import scara_ident.motion.motion
import scara_ident.motion.prepared
from scara_ident.errors import RecordingError, UsageError
from scara_ident.identification.identify import identify
from scara_ident.model.model import TorqueModel
from scara_ident.motion.low_pass import low_pass, low_pass_every
from scara_ident.motion.motion import stretches
from scara_ident.motion.prepared import PreparedStretch, prepare
from scara_ident.motion.sampling import BLOCK_SECONDS, SMOOTH_PER_PERIOD, row_step
from scara_ident.recording.audit import Finding
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, swing, write_urdf

RATE = 500.0
BANDS = (10.0, 10.0)
# In these all rows are multiples of six samples, which are enough for what is smooth.
BELOW = (2.75, 4.1)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R))


@pytest.fixture(scope="module")
def run(robot: Robot) -> Recording:
    return swing(robot)


def only(recording: Recording, bands: tuple[float | None, ...] = BANDS) -> PreparedStretch:
    (part,) = prepare([recording], bands).stretches
    return part


def test_rows_are_the_low_pass_at_the_kept_samples_weighted_to_stand_for_all(run: Recording):
    part = only(run, (6.0, 12.0))
    signals = np.random.default_rng(0).standard_normal((3, part.samples)).cumsum(axis=1)
    for j, band in enumerate((6.0, 12.0)):
        smooth = low_pass(part.fade[j] * signals, RATE, band, part.steps[j])
        assert_allclose(part.smooth(j, signals), smooth, rtol=0, atol=1e-11)
        expected = np.sqrt(part.steps[j]) * smooth[:, part.kept[j]]
        assert_allclose(part.rows(j, signals), expected, rtol=0, atol=1e-11 * np.max(np.abs(smooth)))


# Rows of 72 and 48 samples, and of 80 and 57, which have no common part.
@pytest.mark.parametrize(("bands", "steps", "every"), [(BELOW, (72, 48), 6), ((2.5, 3.5), (80, 57), 7)])
def test_fewer_samples_of_what_is_smooth_give_the_same_rows(
    run: Recording, bands: tuple[float, float], steps: tuple[int, int], every: int
):
    part = only(run, bands)
    assert (part.steps, part.decimation, int(RATE / (SMOOTH_PER_PERIOD * bands[1]))) == (steps, every, every)
    # Without a band nothing is left out.
    assert only(run, (2.5, None)).decimation == 1
    time, random = np.arange(part.samples) / RATE, np.random.default_rng(0)
    # Up to where the low-pass of the positions ends, and some of it beyond.
    frequency, angle = np.array([[0.3], [1.1], [3.9], [9.0], [14.0]]), random.uniform(0.0, 2.0 * np.pi, (5, 1))
    signals = random.standard_normal((3, 5)) @ np.sin(2.0 * np.pi * frequency * time + angle)
    whole = only(run, bands)
    vars(whole)["rest"] = np.zeros((2, whole.samples), dtype=bool)
    vars(whole)["fade"] = np.ones((2, whole.samples))
    # Towards the end the filter continues a signal from its last sample, and the fade towards rest is as long as a few samples.
    for item, rows, least in ((whole, slice(-10), 3e-5), (whole, slice(None), 0.02), (part, slice(None), 0.02)):
        for j in range(2):
            full, few = item.rows(j, signals), item.rows(j, signals[:, ::every], every)
            assert_allclose(few[:, rows], full[:, rows], rtol=0, atol=least * np.max(np.abs(full)))
            assert_array_equal(item.rows_of([(j, signals[1, ::every])], every)[0], few[1])


def test_a_motion_at_fewer_samples_is_every_so_many_of_it_with_no_torque_that_is_faster(run: Recording):
    time = np.arange(len(run.time)) / RATE
    # Above half the lower rate: at every sixth sample it would be one of 3 Hz.
    fast = np.sin(2.0 * np.pi * (RATE / 6.0 + 3.0) * time)
    part = only(run, BELOW)
    loud = only(replace(run, effort=run.effort + 0.5 * fast), BELOW)
    assert part.decimated.rate == pytest.approx(RATE / 6.0)
    assert_array_equal(part.decimated.q, part.motion.q[:, ::6])
    assert_array_equal(part.decimated.a, part.motion.a[:, ::6])
    assert_array_equal(part.decimated.fade, part.motion.fade[:, ::6])
    inside = slice(5, -5)
    assert_allclose(loud.decimated.torque[:, inside], part.decimated.torque[:, inside], rtol=0, atol=0.02)
    assert np.max(np.abs(loud.torque[:, ::6] - part.torque[:, ::6])[:, inside]) > 0.4
    for bands in ((20.0, 10.0), (2.5, None)):
        wide = only(run, bands)
        assert wide.decimation == 1 and wide.decimated is wide.motion
    # Another torque comes with the same states.
    other = part.with_torque_of(loud.stretch)
    assert_allclose(other.decimated.torque, loud.decimated.torque, rtol=0, atol=1e-12)
    assert other.decimated.kinematics is part.decimated.kinematics


def test_without_a_band_every_used_sample_is_a_row_as_it_is(run: Recording):
    part = only(run, (None, None))
    assert part.steps == (1, 1)
    for j in range(2):
        assert_array_equal(part.kept[j], np.flatnonzero(part.used[j]))
        assert_array_equal(part.rows(j, part.torque[j : j + 1])[0], (part.fade[j] * run.effort[j])[part.used[j]])


def test_blocks_hold_the_kept_samples_once(run: Recording):
    part = only(run)
    step = row_step(RATE, BANDS[0])
    assert step > 1
    for j in range(2):
        places = np.arange(0, part.samples, step)
        assert_array_equal(part.kept[j], places[part.used[j][places]])
        starts = part.block_starts(j)
        assert (starts[0], starts[-1]) == (0, len(part.kept[j]))
        for (a, b), (first, last) in zip(
            zip(starts[:-1], starts[1:], strict=True), zip(part.blocks[:-1], part.blocks[1:], strict=True), strict=True
        ):
            inside = part.kept[j][a:b]
            assert np.all((inside >= first) & (inside < last))
    assert (part.blocks[0], part.blocks[-1]) == (part.trim, part.samples - part.trim)
    assert np.max(np.diff(part.blocks)) / RATE < 2.0 * BLOCK_SECONDS
    assert len(part.blocks) > 10


def test_rest_leaves_out_rows_of_its_joint_only(run: Recording):
    full, part = only(run), only(run)
    nowhere = np.zeros((2, full.samples), dtype=bool)
    vars(full)["rest"] = nowhere
    vars(part)["rest"] = nowhere.copy()
    part.rest[0, 1000:2000] = True
    count = [[len(kept) for kept in item.kept] for item in (full, part)]
    assert count[0][0] - count[1][0] == pytest.approx(1000 / row_step(RATE, BANDS[0]), abs=1)
    assert count[0][1] == count[1][1]


def test_what_happens_at_rest_does_not_reach_the_rows(run: Recording):
    """A torque that friction takes up at rest, whatever it is, leaves the equation where the joint moves as it was."""
    clean = only(run)
    assert run.effort is not None
    assert np.any(clean.rest)
    shaken = only(replace(run, effort=run.effort + np.where(clean.rest, 5.0, 0.0)))
    for j in range(2):
        assert_allclose(shaken.smooth(j, shaken.torque[j]), clean.smooth(j, clean.torque[j]), atol=1e-12)
        before, after = (clean.rows(j, item.torque[j : j + 1]) for item in (clean, shaken))
        assert_allclose(after, before, atol=1e-12)


def test_what_is_guessed_at_the_ends_does_not_reach_the_rows():
    """Of a joint that moves there the first acceleration is a guess, and 3 % of it was in the first rows."""
    seconds, rate, turning, band = 4.0, 250.0, 2.0 * np.pi * np.array([[0.3], [0.5]]), 6.0
    time = np.arange(int(seconds * rate)) / rate
    angle = turning * time + 0.7
    part = only(Recording("run", "run", 1, ("j1", "j2"), time, np.sin(angle), np.zeros_like(angle)), (band, band))
    true = -(turning**2) * np.sin(angle)
    wrong = part.motion.a - true
    assert np.max(np.abs(wrong[:, 0] / true[:, 0])) > 0.5
    for j in range(2):
        rows = part.rows(j, wrong[j : j + 1]) / np.sqrt(part.steps[j])
        assert np.max(np.abs(rows)) < 2e-4 * np.max(np.abs(true[j]))


def test_the_slowest_band_decides_what_is_cut_at_the_ends(run: Recording):
    assert only(run, (None, 5.0)).trim == 100
    assert only(run, (20.0, 5.0)).trim == 100
    assert only(run, (None, None)).trim == 20
    part = only(run, (20.0, 5.0))
    assert not part.used[:, :100].any()
    assert not part.used[:, -100:].any()
    assert part.used[:, 100:-100].mean() > 0.8


def test_a_stretch_shorter_than_its_ends_has_nothing_to_use(robot: Robot):
    part = only(swing(robot, seconds=0.3), (5.0, 5.0))
    assert not part.usable
    assert not part.used.any()


def test_a_gap_makes_two_stretches_of_one_recording(run: Recording):
    keep = (run.time < 3.0) | (run.time > 3.5)
    cut = replace(run, time=run.time[keep], position=run.position[:, keep], effort=run.effort[:, keep])
    (item,) = prepare([cut], BANDS).recordings
    assert [part.samples for part in item.stretches] == [1500, np.count_nonzero(run.time > 3.5)]
    assert item.longest is item.stretches[1]
    assert {part.name for part in item.stretches} == {"swing_1"}


def test_recordings_are_prepared_in_their_order_and_known_by_their_trajectory(robot: Robot):
    runs = [swing(robot, name, seed, seconds=4.0) for name, seed in (("b_1", 1), ("a_1", 2), ("b_2", 1))]
    data = prepare(runs, BANDS)
    assert data.trajectories == ("b", "a")
    assert data.labels == ("b", "a", "b")
    assert data.of([2, 1]).labels == data.of([0, 2, 1]).of([1, 2]).labels == ("b", "a")
    assert data.at((6.0, 6.0)).motions is data.motions
    assert data.at((6.0, 6.0)).periods is data.periods
    assert data.of([2, 0]).periods == tuple(data.periods[k] for k in (2, 0))
    assert data.sources == tuple(runs)
    assert [item.name for item in data.of([2, 0]).recordings] == ["b_2", "b_1"]
    assert data.bands == BANDS
    assert prepare(runs).bands == (None, None)
    assert prepare([], BANDS).bands == BANDS
    assert prepare([], BANDS).stretches == ()


def test_a_torque_is_needed_only_where_it_is_asked_for(run: Recording):
    part = only(replace(run, effort=None))
    assert len(part.kept[0]) > 0
    with pytest.raises(RecordingError, match="swing_1: no effort was recorded"):
        part.torque  # noqa: B018


def test_another_torque_on_the_same_motion(run: Recording):
    (item,) = prepare([run], BANDS).recordings
    (before,) = item.stretches
    other = item.with_effort_of(replace(item.recording, effort=2.0 * item.recording.effort))
    (after,) = other.stretches
    assert_allclose(after.smooth(0, after.torque), 2.0 * before.smooth(0, before.torque))
    assert_array_equal(after.motion.a, before.motion.a)
    assert_array_equal(before.torque, run.effort)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter:
    """How often recordings are cut, each joint is differentiated at each cut-off, and a motion becomes columns."""
    count: Counter = Counter()
    differentiate = scara_ident.motion.motion.differentiate

    def cut(recording):
        count[recording.name] += 1
        return stretches(recording)

    def filtered(signal, rate, cut):
        count.update((row.tobytes(), cut) for row in np.atleast_2d(signal))
        return differentiate(signal, rate, cut)

    joint_columns = TorqueModel.joint_columns

    def columns(model, motion, *into):
        count[motion] += 1
        return joint_columns(model, motion, *into)

    monkeypatch.setattr(TorqueModel, "joint_columns", columns)
    monkeypatch.setattr(scara_ident.motion.prepared, "stretches", cut)
    monkeypatch.setattr(scara_ident.motion.motion, "differentiate", filtered)
    return count


def test_other_bands_share_what_does_not_depend_on_them(counted: Counter, run: Recording):
    data = prepare([run], (9.0, 18.0))
    _ = [part.motion for other in ((9.0, 18.0), (9.0, 12.0), (7.0, 18.0)) for part in data.at(other).stretches]
    assert data.recordings[0].at((9.0, 18.0)) is data.recordings[0]
    assert max(counted.values()) == 1
    # One cut, and two cut-offs for each of the joints.
    assert len(counted) == 1 + 2 + 2


def test_an_identification_makes_stretches_once_and_motion_and_columns_once_per_cut_off(counted: Counter, robot: Robot):
    names = ("a_1", "a_2", "b_1")
    runs = [swing(robot, name, seed) for seed, name in enumerate(names)]
    held_out = swing(robot, "c_1", 9)
    result = identify(robot, runs, model="basic", method="wls", validation=[held_out])
    result.training_errors()
    result.validation_errors()
    assert {name: counted[name] for name in (*names, "c_1")} == dict.fromkeys((*names, "c_1"), 1)
    assert max(counted.values()) == 1
    cuts = {key[1] for key in counted if isinstance(key, tuple)}
    assert {cut for part in result.training.data.stretches for cut in part.cuts} <= cuts


def test_signals_of_several_joints_pass_the_filter_together_as_alone(run: Recording):
    part = only(run, (6.0, 9.0))
    rng = np.random.default_rng(3)
    joints = [0, 1, 1, 0, *([1] * 12)]
    signals = rng.standard_normal((len(joints), part.samples))
    found = part.rows_of(list(zip(joints, signals, strict=True)))
    for joint, signal, rows in zip(joints, signals, found, strict=True):
        assert_allclose(rows, part.rows(joint, signal[None])[0], rtol=0, atol=1e-13)
    assert part.rows_of([]) == []


def test_what_does_not_act_has_rows_of_zero_and_is_not_filtered(monkeypatch: pytest.MonkeyPatch, run: Recording):
    part, filtered = only(run), list[int]()

    def counted(signals: np.ndarray, *given: object) -> np.ndarray:
        filtered.append(len(signals))
        return low_pass_every(signals, *given)

    signals = np.random.default_rng(4).standard_normal((4, part.samples))
    alone = part.rows(0, signals[2:])
    signals[:2] = 0.0
    monkeypatch.setattr(scara_ident.motion.prepared, "low_pass_every", counted)
    rows = part.rows(0, signals[[0, 2, 1, 3]])
    assert sum(filtered) == 2
    assert_array_equal(rows[[0, 2]], 0.0)
    assert_allclose(rows[[1, 3]], alone, rtol=0, atol=1e-14)
    assert part.rows(0, signals[:2]).shape == (2, len(part.kept[0]))


def test_clipped_torque_is_left_out_of_its_joint_and_nothing_else(robot: Robot) -> None:
    whole = swing(robot)
    assert whole.effort is not None
    bound = float(np.percentile(whole.effort[0], 90.0))
    effort = whole.effort.copy()
    effort[0] = np.minimum(effort[0], bound)
    clipped = replace(whole, effort=effort, findings=(Finding("saturation", "clipped", 1, (0, bound)),))
    (part,) = prepare([clipped], BANDS).stretches
    (free,) = prepare([whole], BANDS).stretches
    at = effort[0] == bound
    assert 20 < np.count_nonzero(at) < 0.5 * len(at)
    assert_array_equal(part.used[0], free.used[0] & ~at)
    assert_array_equal(part.used[1], free.used[1])
    # Nothing of the clipped torque passes the filter to rows that are kept.
    estimates = [identify(robot, [item], bands=BANDS).estimate for item in (whole, clipped)]
    assert_allclose(estimates[1].value, estimates[0].value, atol=4.0 * np.max(estimates[1].std))


def test_an_identification_does_not_look_for_periods(monkeypatch: pytest.MonkeyPatch, robot: Robot, run: Recording):
    """Only the tests of a diagnosis ask for them, and they take as long as a tenth of an identification."""
    monkeypatch.setattr(scara_ident.motion.prepared, "periods_of", lambda _: pytest.fail("looked for periods"))
    assert identify(robot, [run]).estimate.value.size


@pytest.mark.parametrize(
    ("bands", "said"),
    [
        ([-1, 2], "band of j1 is -1; expected a frequency above 0"),
        ([2.0, np.nan], "band of j2 is nan"),
        (["wide", None], "band of j1 is 'wide'"),
        ([2.0], "bands: 1 given; expected one for each of j1, j2"),
    ],
)
def test_bands_that_are_none_are_said(run: Recording, bands, said: str):
    with pytest.raises(UsageError, match=said):
        prepare([run], bands)


def test_a_motion_says_where_its_joints_stand_still(run: Recording):
    part = only(run)
    assert_array_equal(part.motion.fade == 0.0, part.rest)
    assert part.moving is part.motion.fade
    # An event left out is none of the motion's.
    left_out = np.zeros(part.samples, dtype=bool)
    left_out[200:260] = True
    beside = replace(part, left_out=left_out)
    assert_array_equal(beside.motion.fade, part.motion.fade)
    assert np.all(beside.moving[:, left_out] == 0.0)
    assert np.all(beside.fade[:, left_out] == 0.0)
    assert_array_equal(part.motion.part(100, 300).fade, part.motion.fade[:, 100:300])
    assert part.motion.with_torque(None).fade is part.motion.fade
