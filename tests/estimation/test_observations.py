"""Rows of a recording: what is kept, what is left out, and that bookkeeping changes nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.errors import RecordingError
from scara_ident.estimation import ols
from scara_ident.estimation.information import merge
from scara_ident.estimation.observations import gather, gather_all
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.motion import low_pass, motion_of, stretches
from scara_ident.motion.prepared import fading, position_cuts, row_step, rows_of, standstill
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, recorded_torque, recording, sines, write_urdf

RATE = 500.0
FRICTION = ((0.4, 0.3, 0.0, 0.0, 0.1), (0.2, 0.1, 0.0, 0.0, -0.05))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    path = write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)
    return build_model(load_robot(path), "basic")


def swing(model: TorqueModel, name: str = "swing_1", seed: int = 0, seconds: float = 12.0) -> Recording:
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = sines(np.random.default_rng(seed), time, model.robot.n)
    return recording(model.robot, name, time, q, recorded_torque(model.robot, q, v, a, FRICTION))


@pytest.fixture(scope="module")
def one(model: TorqueModel) -> Recording:
    return swing(model)


@pytest.fixture(scope="module")
def truth(model: TorqueModel) -> np.ndarray:
    inertial = model.rigid_body.base.grouping @ model.robot.standard_parameters()
    friction = [x for row in FRICTION for x in row[:2]]
    return np.array([*inertial, *friction, *(row[4] for row in FRICTION)])


def test_without_noise_the_rows_give_the_true_parameters(model: TorqueModel, one: Recording, truth: np.ndarray):
    for bands in ([10.0, 10.0], [5.0, 20.0]):
        found = ols(model, [gather(model, one, bands)])
        assert not found.undetermined.any()
        assert_allclose(found.value, truth, rtol=0, atol=2e-3 * np.max(np.abs(truth)))


def test_unfiltered_rows_of_clean_data_give_the_true_parameters(model: TorqueModel, one: Recording, truth: np.ndarray):
    found = ols(model, [gather(model, one, [None, None])])
    assert_allclose(found.value, truth, rtol=0, atol=1e-4 * np.max(np.abs(truth)))


def test_rows_count_samples_whatever_the_band_keeps(model: TorqueModel, one: Recording):
    for bands in ([4.0, 4.0], [10.0, 25.0], [None, None]):
        item = gather(model, one, bands)
        assert item.samples == len(one.time)
        assert item.row_step == tuple(row_step(RATE, band) for band in bands)
        left = len(one.time) - item.left_out_ends * RATE
        for j in range(2):
            banded, raw = item.joint(j), item.unfiltered[j]
            assert banded.rows == pytest.approx(left * (1 - item.left_out_rest[j]), rel=0.02)
            assert raw.rows == pytest.approx(left * (1 - item.left_out_rest[j]), rel=1e-6)
            # Kept rows are weighted to stand for the others: power and rms do not depend on their number.
            assert banded.torque_rms == pytest.approx(raw.torque_rms, rel=0.05)


def test_rows_within_the_band_lose_nothing_to_those_not_kept(model: TorqueModel, one: Recording):
    """Every sample as a row gives the same information as the few that are kept and weighted."""
    bands = [8.0, 8.0]
    (part,) = stretches(one)
    rows = rows_of(model, part, bands)
    item = gather(model, one, bands)
    ends = round(item.left_out_ends * RATE / 2)
    rest = standstill(part, rows.motion, bands)
    for j in range(2):
        keep = ~rest[j]
        keep[:ends] = keep[-ends:] = False
        columns = rows.banded[j][:, keep]
        size = np.linalg.norm(columns, axis=1)
        size[size == 0.0] = 1.0
        expected = (columns / size[:, None]) @ (columns / size[:, None]).T
        factor = item.joint(j).factor
        assert_allclose(factor.T @ factor / np.outer(size, size), expected, atol=0.03)


def test_both_sides_pass_the_same_filter(model: TorqueModel, one: Recording):
    (part,) = stretches(one)
    rows = rows_of(model, part, [6.0, 12.0])
    motion = motion_of(part, position_cuts(part.rate, [6.0, 12.0]))
    regressor = model.regressor(motion)
    assert one.effort is not None
    for j, band in enumerate((6.0, 12.0)):
        weight = fading(rows.rest, part.rate, [6.0, 12.0])[j]
        assert_allclose(rows.banded[j][-1], low_pass(weight * one.effort[j], part.rate, band), atol=1e-12)
        assert_allclose(rows.banded[j][:-1], low_pass(weight * regressor[j], part.rate, band), atol=1e-11)
        assert_allclose(rows.raw[j], np.vstack([regressor[j], one.effort[j]]), atol=1e-12)


def test_the_order_of_recordings_does_not_matter(model: TorqueModel, one: Recording):
    recordings = [one, swing(model, "other_1", seed=1, seconds=8.0), swing(model, "other_2", seed=2, seconds=6.0)]
    forth = gather_all(model, recordings, [10.0, 10.0])
    back = gather_all(model, recordings[::-1], [10.0, 10.0])
    assert [item.recording for item in forth] == ["swing_1", "other_1", "other_2"]
    assert [item.trajectory for item in back] == ["other", "other", "swing"]
    assert_allclose(ols(model, forth).value, ols(model, back).value, rtol=1e-9)
    assert_allclose(ols(model, forth).std, ols(model, back).std, rtol=1e-6)


def test_splitting_a_recording_costs_its_new_ends_only(model: TorqueModel, truth: np.ndarray):
    bands = [10.0, 10.0]
    whole = swing(model, seconds=20.0)
    assert whole.effort is not None
    halves = [
        replace(
            whole, name=f"half_{k}", time=whole.time[a:b], position=whole.position[:, a:b], effort=whole.effort[:, a:b]
        )
        for k, (a, b) in enumerate(((0, 5000), (5000, 10000)))
    ]
    one, two = gather(model, whole, bands), gather_all(model, halves, bands)
    assert sum(item.samples for item in two) == one.samples
    assert sum(item.left_out_ends for item in two) == pytest.approx(2 * one.left_out_ends, rel=1e-6)
    assert sum(item.joint(0).rows for item in two) == pytest.approx(one.joint(0).rows, rel=0.04)
    split, joined = ols(model, two).value, ols(model, [one]).value
    assert_allclose(split, joined, rtol=0, atol=2e-3 * np.max(np.abs(truth)))


def test_a_gap_is_two_stretches_of_one_recording(model: TorqueModel, one: Recording, truth: np.ndarray):
    assert one.effort is not None
    keep = (one.time < 5.0) | (one.time > 5.5)
    cut = replace(one, time=one.time[keep], position=one.position[:, keep], effort=one.effort[:, keep])
    item = gather(model, cut, [10.0, 10.0])
    assert item.left_out_ends == pytest.approx(2 * gather(model, one, [10.0, 10.0]).left_out_ends)
    assert_allclose(ols(model, [item]).value, truth, rtol=0, atol=3e-3 * np.max(np.abs(truth)))


def test_the_unit_of_torque_scales_the_parameters(model: TorqueModel, one: Recording):
    """Millinewton metres with an effort gain of 1e-3 are newton metres; without it everything is a thousandfold."""
    assert one.effort is not None
    bands = [10.0, 10.0]
    milli = replace(one, effort=1e3 * one.effort)
    plain, large = ols(model, [gather(model, one, bands)]), ols(model, [gather(model, milli, bands)])
    assert_allclose(large.value, 1e3 * plain.value, rtol=1e-9)
    assert_allclose(large.std, 1e3 * plain.std, rtol=1e-6)


def test_samples_at_rest_are_left_out(model: TorqueModel, truth: np.ndarray):
    """Friction of a joint at rest is anything up to Coulomb's: it may not enter."""
    one = swing(model, seconds=12.0)
    assert one.effort is not None
    stop = 2 * round(RATE)
    time = np.arange(len(one.time) + stop) / RATE
    position = np.concatenate([one.position, np.repeat(one.position[:, -1:], stop, axis=1)], axis=1)
    # At rest a torque that no model explains.
    effort = np.concatenate([one.effort, np.full((2, stop), 7.0)], axis=1)
    item = gather(model, replace(one, time=time, position=position, effort=effort), [20.0, 20.0])
    # Slow turning points are left out too, with the filter's memory on both sides.
    clean = gather(model, one, [20.0, 20.0])
    for share, moving in zip(item.left_out_rest, clean.left_out_rest, strict=True):
        assert share == pytest.approx(stop / len(time) + moving, abs=0.02)
    assert item.joint(0).rows == pytest.approx(clean.joint(0).rows, rel=0.03)
    # The stop itself is a jerk within the band; what is fitted is the motion all the same.
    assert item.unfiltered[0].rows < len(one.time) * 1.01


def test_the_noise_of_an_encoder_is_not_taken_for_motion(model: TorqueModel):
    one = swing(model)
    noisy = one.position.copy()
    noisy[1] = 0.3 + 1e-4 * np.random.default_rng(0).standard_normal(len(one.time))
    item = gather(model, replace(one, position=noisy), [10.0, 10.0])
    assert item.left_out_rest[1] == 1.0
    assert item.joint(1).rows == item.unfiltered[1].rows == 0
    # Of the moving joint only the turning points.
    assert item.left_out_rest[0] < 0.1


def test_little_is_left_out_at_turning_points(model: TorqueModel, one: Recording):
    """Only where a joint is slow for several milliseconds, and then half a period of the band on both sides."""
    turns = max(int(np.count_nonzero(np.diff(np.sign(np.diff(row))))) for row in one.position)
    most = (turns + 1) * (2 * 0.5 / 10.0 + 0.02) / (one.time[-1] - one.time[0])
    assert max(gather(model, one, [10.0, 10.0]).left_out_rest) < most


def test_a_recording_at_rest_is_refused_in_one_line(model: TorqueModel, one: Recording):
    still = replace(one, position=np.zeros_like(one.position), path=Path("here/still_1.csv"))
    with pytest.raises(RecordingError) as caught:
        gather(model, still, [10.0, 10.0])
    message = str(caught.value)
    assert message.startswith("here/still_1.csv: nothing is left of 6000 samples")
    assert "\n" not in message


def test_a_recording_shorter_than_its_ends_is_refused(model: TorqueModel):
    short = swing(model, seconds=0.3)
    with pytest.raises(RecordingError, match="nothing is left of 150 samples"):
        gather(model, short, [5.0, 5.0])


def test_effort_is_needed(model: TorqueModel, one: Recording):
    with pytest.raises(RecordingError, match="swing_1: no effort was recorded"):
        gather(model, replace(one, effort=None), [10.0, 10.0])


def test_blocks_together_are_the_recording(model: TorqueModel, one: Recording):
    item = gather(model, one, [10.0, 10.0])
    assert len(item.blocks) >= 15
    for j in range(2):
        whole = item.joint(j)
        assert whole.rows == sum(block[j].rows for block in item.blocks)
        assert whole.rms() == pytest.approx(merge(block[j] for block in item.blocks).rms(), rel=1e-12)


def test_filters_follow_the_band():
    assert position_cuts(1000.0, [10.0, None, 200.0]) == [30.0, None, None]
    assert (row_step(1000.0, None), row_step(1000.0, 10.0), row_step(1000.0, 900.0)) == (1, 40, 1)
