"""Rows of recordings: what is kept, what is left out, and that bookkeeping changes nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.errors import RecordingError
from scara_ident.estimation import ols
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.observations import Observations, informations, observe
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, SWING_FRICTION, swing, write_urdf
from tests.estimation.made import together

RATE = 500.0
BANDS = (10.0, 10.0)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    path = write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R)
    return build_model(load_robot(path), "basic")


@pytest.fixture(scope="module")
def one(model: TorqueModel) -> Recording:
    return swing(model.robot)


@pytest.fixture(scope="module")
def truth(model: TorqueModel) -> np.ndarray:
    inertial = model.rigid_body.base.grouping @ model.robot.standard_parameters()
    friction = [x for row in SWING_FRICTION for x in row[:2]]
    return np.array([*inertial, *friction, *(row[4] for row in SWING_FRICTION)])


def seen(model: TorqueModel, *recordings: Recording, bands: Sequence[float | None] = BANDS) -> Observations:
    return observe(model, prepare(recordings, bands))


def assert_same(one: Information, other: Information) -> None:
    """Equal as statistics: the signs of a factor's rows are free."""
    size = np.linalg.norm(other.factor, axis=0)
    size[size == 0.0] = 1.0
    found, expected = (item.factor.T @ item.factor / np.outer(size, size) for item in (one, other))
    assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert one.rows == pytest.approx(other.rows, rel=1e-14)


def test_without_noise_the_rows_give_the_true_parameters(model: TorqueModel, one: Recording, truth: np.ndarray):
    for bands in ([10.0, 10.0], [5.0, 20.0]):
        found = ols(seen(model, one, bands=bands))
        assert not found.undetermined.any()
        assert_allclose(found.value, truth, rtol=0, atol=2e-3 * np.max(np.abs(truth)))


def test_unfiltered_rows_of_clean_data_give_the_true_parameters(model: TorqueModel, one: Recording, truth: np.ndarray):
    found = ols(seen(model, one, bands=[None, None]))
    assert_allclose(found.value, truth, rtol=0, atol=1e-4 * np.max(np.abs(truth)))


def test_rows_count_samples_whatever_the_band_keeps(model: TorqueModel, one: Recording):
    for bands in ([4.0, 4.0], [10.0, 25.0], [None, None]):
        item = seen(model, one, bands=bands)
        assert item.samples == len(one.time)
        left = len(one.time) - item.left_out_ends * RATE
        unfiltered = item.unfiltered_rms(np.zeros(item.parameters))
        for j, banded in enumerate(item.by_joint):
            assert banded.rows == pytest.approx(left * (1 - item.left_out_rest[j]), rel=0.02)
            # Kept rows are weighted to stand for the others: power and rms do not depend on their number.
            assert banded.torque_rms == pytest.approx(unfiltered[j], rel=0.05)


def test_rows_within_the_band_lose_nothing_to_those_not_kept(model: TorqueModel, one: Recording):
    """Every sample as a row gives the same information as the few that are kept and weighted."""
    item = seen(model, one, bands=[8.0, 8.0])
    (part,), ((raw,),) = item.data.stretches, item.raw
    for j, rows in enumerate(item.joints):
        every = part.smooth(j, np.vstack([raw[j], part.torque[j]]))[:, part.used[j]]
        size = np.linalg.norm(every, axis=1)
        expected = (every / size[:, None]) @ (every / size[:, None]).T
        kept = rows.table / size[:, None]
        assert_allclose(kept @ kept.T, expected, atol=0.03)


def test_both_sides_pass_the_same_filter(model: TorqueModel, one: Recording):
    bands = (6.0, 12.0)
    item = seen(model, one, bands=bands)
    (part,), ((raw,),) = item.data.stretches, item.raw
    regressor = model.regressor(part.motion)
    assert one.effort is not None
    for j, (band, rows) in enumerate(zip(bands, item.joints, strict=True)):
        assert_array_equal(rows.columns, np.flatnonzero(model.pattern[j]))
        assert_allclose(raw[j], regressor[j][rows.columns], atol=1e-12)
        # Columns that do not act on the joint are zero, so nothing is left out with them.
        assert not np.any(np.delete(regressor[j], rows.columns, axis=0))
        both = np.vstack([regressor[j][rows.columns], one.effort[j]])
        smooth = low_pass(part.fade[j] * both, part.rate, band, part.steps[j])
        assert_allclose(rows.table, np.sqrt(part.steps[j]) * smooth[:, part.kept[j]], rtol=0, atol=1e-10)


def test_the_order_of_recordings_does_not_matter(model: TorqueModel, one: Recording):
    recordings = [
        one, swing(model.robot, "other_1", seed=1, seconds=8.0), swing(model.robot, "other_2", seed=2, seconds=6.0)
    ]  # fmt: skip
    forth, back = seen(model, *recordings), seen(model, *recordings[::-1])
    assert [item.name for item in forth.each] == ["swing_1", "other_1", "other_2"]
    # Two motions of one name are no repetitions.
    assert [item.trajectory for item in back.each] == ["other_2", "other_1", "swing"]
    # Some are zero.
    assert_allclose(ols(forth).value, ols(back).value, rtol=1e-9, atol=1e-14)
    assert_allclose(ols(forth).std, ols(back).std, rtol=1e-6)


def test_splitting_a_recording_costs_its_new_ends_only(model: TorqueModel, truth: np.ndarray):
    whole = swing(model.robot, seconds=20.0)
    assert whole.effort is not None
    halves = [
        replace(
            whole, name=f"half_{k}", time=whole.time[a:b], position=whole.position[:, a:b], effort=whole.effort[:, a:b]
        )
        for k, (a, b) in enumerate(((0, 5000), (5000, 10000)))
    ]
    one, two = seen(model, whole), seen(model, *halves)
    assert two.samples == one.samples
    assert two.left_out_ends == pytest.approx(2 * one.left_out_ends, rel=1e-6)
    assert two.by_joint[0].rows == pytest.approx(one.by_joint[0].rows, rel=0.04)
    assert_allclose(ols(two).value, ols(one).value, rtol=0, atol=2e-3 * np.max(np.abs(truth)))


def test_a_gap_is_two_stretches_of_one_recording(model: TorqueModel, one: Recording, truth: np.ndarray):
    assert one.effort is not None
    keep = (one.time < 5.0) | (one.time > 5.5)
    cut = replace(one, time=one.time[keep], position=one.position[:, keep], effort=one.effort[:, keep])
    item = seen(model, cut)
    assert len(item.raw) == 1
    assert len(item.raw[0]) == 2
    assert set(item.owner) == {0}
    assert item.left_out_ends == pytest.approx(2 * seen(model, one).left_out_ends)
    assert_allclose(ols(item).value, truth, rtol=0, atol=3e-3 * np.max(np.abs(truth)))


def test_the_unit_of_torque_scales_the_parameters(model: TorqueModel, one: Recording):
    """Millinewton metres with an effort gain of 1e-3 are newton metres; without it everything is a thousandfold."""
    assert one.effort is not None
    milli = replace(one, effort=1e3 * one.effort)
    plain, large = ols(seen(model, one)), ols(seen(model, milli))
    assert_allclose(large.value, 1e3 * plain.value, rtol=1e-9, atol=1e-11)
    assert_allclose(large.std, 1e3 * plain.std, rtol=1e-6)


def test_samples_at_rest_are_left_out(model: TorqueModel):
    """Friction of a joint at rest is anything up to Coulomb's: it may not enter."""
    one = swing(model.robot, seconds=12.0)
    assert one.effort is not None
    stop = 2 * round(RATE)
    time = np.arange(len(one.time) + stop) / RATE
    position = np.concatenate([one.position, np.repeat(one.position[:, -1:], stop, axis=1)], axis=1)
    # At rest a torque that no model explains.
    effort = np.concatenate([one.effort, np.full((2, stop), 7.0)], axis=1)
    item = seen(model, replace(one, time=time, position=position, effort=effort), bands=(20.0, 20.0))
    # Slow turning points are left out too, with the filter's memory on both sides.
    clean = seen(model, one, bands=(20.0, 20.0))
    for share, moving in zip(item.left_out_rest, clean.left_out_rest, strict=True):
        assert share == pytest.approx(stop / len(time) + moving, abs=0.02)
    assert item.by_joint[0].rows == pytest.approx(clean.by_joint[0].rows, rel=0.03)
    # Nothing of those 7 N m shows in the torque as recorded either.
    nothing = np.zeros(item.parameters)
    assert_allclose(item.unfiltered_rms(nothing), clean.unfiltered_rms(nothing), rtol=0.03)


def test_the_noise_of_an_encoder_is_not_taken_for_motion(model: TorqueModel, one: Recording):
    noisy = one.position.copy()
    noisy[1] = 0.3 + 1e-4 * np.random.default_rng(0).standard_normal(len(one.time))
    item = seen(model, replace(one, position=noisy))
    assert item.left_out_rest[1] == 1.0
    assert item.by_joint[1].rows == 0
    left = item.unfiltered_rms(np.zeros(item.parameters))
    assert np.isfinite(left[0])
    assert np.isnan(left[1])
    # Of the moving joint only the turning points.
    assert item.left_out_rest[0] < 0.1


def test_little_is_left_out_at_turning_points(model: TorqueModel, one: Recording):
    """Only where a joint is slow for several milliseconds, and then half a period of the band on both sides."""
    turns = max(int(np.count_nonzero(np.diff(np.sign(np.diff(row))))) for row in one.position)
    most = (turns + 1) * (2 * 0.5 / 10.0 + 0.02) / (one.time[-1] - one.time[0])
    assert max(seen(model, one).left_out_rest) < most


def test_a_recording_at_rest_is_refused_in_one_line(model: TorqueModel, one: Recording):
    still = replace(one, position=np.zeros_like(one.position), path=Path("here/still_1.csv"))
    with pytest.raises(RecordingError) as caught:
        seen(model, one, still)
    message = str(caught.value)
    assert message.startswith("here/still_1.csv: none of 6000 samples can be used")
    assert "\n" not in message


def test_a_recording_shorter_than_its_ends_is_refused(model: TorqueModel):
    short = swing(model.robot, seconds=0.3)
    with pytest.raises(RecordingError, match="none of 150 samples can be used"):
        seen(model, short, bands=(5.0, 5.0))


def test_effort_is_needed(model: TorqueModel, one: Recording):
    with pytest.raises(RecordingError, match="swing_1: no effort was recorded"):
        seen(model, replace(one, effort=None))


def test_blocks_together_are_the_recording(model: TorqueModel, one: Recording):
    item = seen(model, one)
    assert item.blocks >= 15
    for j, whole in enumerate(item.by_joint):
        assert_same(merge(item.block(b)[j] for b in range(item.blocks)), whole)


@pytest.fixture(scope="module")
def several(model: TorqueModel) -> Observations:
    """Four recordings, one with a gap, which is two stretches, and one with a joint that never moves."""
    runs = [swing(model.robot, f"swing_{k}", seed=k, seconds=3.0 + k) for k in range(4)]
    keep = (runs[3].time < 2.0) | (runs[3].time > 2.5)
    runs[3] = replace(
        runs[3], time=runs[3].time[keep], position=runs[3].position[:, keep], effort=runs[3].effort[:, keep]
    )
    runs[1] = replace(runs[1], position=np.stack([runs[1].position[0], np.full_like(runs[1].time, 0.2)]))
    return seen(model, *runs)


@settings(max_examples=20)
@given(order=st.permutations(range(4)), count=st.integers(1, 4))
def test_recordings_together_are_those_absorbed_apart(several: Observations, order: list[int], count: int):
    model, places = several.model, order[:count]
    apart = [seen(model, several.data.recordings[k].recording) for k in places]
    for j, whole in enumerate(several.of(places).by_joint):
        assert_same(whole, merge(item.by_joint[j] for item in apart))
    joined = together(apart)
    for chosen in (several.of(places), seen(model, *(several.data.recordings[k].recording for k in places))):
        assert_array_equal(chosen.owner, joined.owner)
        assert chosen.data.sources == joined.data.sources
        for found, expected in zip(chosen.joints, joined.joints, strict=True):
            assert_array_equal(found.starts, expected.starts)
            assert_array_equal(found.counts, expected.counts)
            assert_allclose(found.table, expected.table, rtol=0, atol=1e-11)
        value = np.arange(1.0, chosen.parameters + 1)
        assert_allclose(chosen.unfiltered_rms(value), joined.unfiltered_rms(value), rtol=1e-12)


def test_a_recording_alone_is_one_of_each(several: Observations):
    assert [item.name for item in several.each] == [f"swing_{k}" for k in range(4)]
    assert sum(item.blocks for item in several.each) == several.blocks
    for k, item in enumerate(several.each):
        assert item.data.recordings == (several.data.recordings[k],)
        for j, information in enumerate(item.by_joint):
            own = np.flatnonzero(several.owner == k)
            assert_same(information, several.joints[j].part(own).information(several.parameters))
    assert several.each[0].each == (several.each[0],)


def test_another_torque_leaves_the_columns_and_says_what_its_recordings_say(several: Observations, model: TorqueModel):
    rng = np.random.default_rng(0)
    runs = [replace(run, effort=rng.standard_normal(run.effort.shape)) for run in several.data.sources]
    expected = seen(model, *runs)
    found = several.with_torque(expected.data)
    for other, rows, before in zip(expected.joints, found.joints, several.joints, strict=True):
        assert_allclose(rows.table, other.table, rtol=0, atol=1e-10)
        assert_array_equal(rows.table[:-1], before.table[:-1])
    value = np.ones(found.parameters)
    assert_allclose(found.unfiltered_rms(value), expected.unfiltered_rms(value), rtol=1e-12)


def test_the_predicted_torque_is_the_models_at_every_sample(several: Observations, model: TorqueModel):
    value = np.random.default_rng(1).standard_normal(several.parameters)
    found = several.predicted(value)
    assert len(found) == 5
    for part, torque in zip(several.data.stretches, found, strict=True):
        assert_allclose(torque, np.einsum("jpn,p->jn", model.regressor(part.motion), value), atol=1e-10)


def test_a_faded_block_counts_for_its_share(several: Observations):
    (rows, _), p = several.joints, several.parameters
    shares = np.linspace(0.1, 1.0, several.blocks)
    factors = [rows.information(p, slice(b, b + 1)).scaled(np.sqrt(share)) for b, share in enumerate(shares)]
    found = rows.faded(shares).information(p)
    assert_same(Information(found.factor, 0.0), Information(merge(factors).factor, 0.0))
    assert found.rows == pytest.approx(rows.counts @ shares)


def test_no_recordings_are_no_rows(model: TorqueModel):
    nothing = observe(model, prepare([], BANDS))
    assert (nothing.blocks, nothing.samples, nothing.each) == (0, 0, ())
    assert all(information.rows == 0.0 for information in nothing.by_joint)
    assert np.isnan(nothing.unfiltered_rms(np.zeros(nothing.parameters))).all()


def test_recordings_that_are_known_in_the_bands_are_not_observed_again(
    model: TorqueModel, one: Recording, monkeypatch: pytest.MonkeyPatch
):
    other = swing(model.robot, "swing_2", 1)
    known, whole = seen(model, one), seen(model, one, other)
    made = []
    columns = TorqueModel.joint_columns
    monkeypatch.setattr(TorqueModel, "joint_columns", lambda *given: made.append(given[1].name) or columns(*given))
    found = observe(model, prepare([one, other], BANDS), known)
    assert made == ["swing_2"]
    for one_joint, other_joint in zip(found.joints, whole.joints, strict=True):
        assert_array_equal(one_joint.table, other_joint.table)
    # In other bands nothing is known.
    observe(model, prepare([one], (5.0, 5.0)), known)
    assert made[1:] == [one.name]


def test_the_factors_alone_are_those_of_the_rows(model: TorqueModel, one: Recording):
    gap = np.arange(len(one.time)) // 1000 != 2
    cut = replace(one, name="swing_3", time=one.time[gap], position=one.position[:, gap], effort=one.effort[:, gap])
    data = prepare([one, swing(model.robot, "swing_2", 1), cut], (10.0, 25.0))
    assert len(data.stretches) == 4
    for found, wanted in zip(informations(model, data), observe(model, data).by_joint, strict=True):
        assert_same(found, wanted)
    assert all(information.rows == 0.0 for information in informations(model, prepare([], BANDS)))


def test_observations_hold_the_data_that_they_were_made_of(model: TorqueModel, one: Recording):
    """What is kept by the data, as the noise of positions, is then found by its observations too."""
    data = prepare([one], BANDS)
    observations = observe(model, data)
    assert observations.data is data
    assert observe(model, data, known=observations).data.recordings == data.recordings
