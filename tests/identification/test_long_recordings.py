"""Files read in parts: what is identified is what the whole says, and what is held of them does not grow."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.export.identified_model import identified_model
from scara_ident.identification import long_recordings
from scara_ident.identification.binned_residual import BIN
from scara_ident.identification.identify import Identification, identify
from scara_ident.recording import long_file
from scara_ident.recording.recording import Recording, read_recording, write_recording
from scara_ident.report.identification import identification_dict
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, noisy, swing, write_urdf
from tests.truth.pushes import pushed

ROBOT = load_robot()
BANDS = [8.0, 8.0]


@pytest.fixture(autouse=True)
def _short_pieces(monkeypatch):
    monkeypatch.setattr(long_file, "MAX_SAMPLES", 2_000)
    monkeypatch.setattr(long_file, "PART_SAMPLES", 5_000)


@pytest.fixture(scope="module")
def run() -> Recording:
    return noisy(swing(ROBOT, "swing_1", seconds=60.0, rate=250.0), np.random.default_rng(0), 0.01)


def written(folder: Path, run: Recording) -> Path:
    path = folder / f"{run.name}.parquet"
    write_recording(run, path, effort_gain=ROBOT.effort_gain)
    return path


def in_parts(monkeypatch, path: Path) -> Recording:
    """Read a file as if it were too long."""
    with monkeypatch.context() as patched:
        patched.setattr(long_file, "LONGEST_WHOLE", 1_000)
        found = read_recording(path, ROBOT)
    assert found.long is not None
    return found


def assert_same(one: Identification, other: Identification) -> None:
    # Sums in another order: rounding times the regressor's condition.
    assert one.estimate.value == pytest.approx(other.estimate.value, rel=1e-9)
    assert one.estimate.std == pytest.approx(other.estimate.std, rel=1e-9)
    assert (one.estimate.std_kind, one.training.samples) == (other.estimate.std_kind, other.training.samples)
    assert one.log_det == pytest.approx(other.log_det, rel=1e-9)
    for name, errors in one.training_errors().items():
        for mine, its in zip(errors, other.training_errors()[name], strict=True):
            assert mine is not None
            assert its is not None
            assert (mine.rms, mine.rms_unfiltered) == pytest.approx((its.rms, its.rms_unfiltered), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["wls", "ols", "rls"])
def test_parts_say_what_the_whole_says(run, tmp_path, monkeypatch, method):
    path = written(tmp_path, run)
    parts = identify(ROBOT, in_parts(monkeypatch, path), method=method, bands=BANDS)
    assert_same(parts, identify(ROBOT, path, method=method, bands=BANDS))
    assert "from all 15000 samples, read in 4 parts" in " ".join(parts.notes)


@pytest.mark.slow
def test_of_a_file_read_in_parts_no_range_is_stated_for_only_a_part_is_held(run, tmp_path, monkeypatch):
    long = in_parts(monkeypatch, written(tmp_path, run))
    for recording, stated in ((long, False), (run, True)):
        found = identify(ROBOT, [recording], bands=BANDS)
        assert (identification_dict(found)["range"] is not None) == stated
        assert (identified_model(found).reached is not None) == stated


def test_bands_chosen_and_events_found_are_those_of_the_whole_beside_another_recording(run, tmp_path, monkeypatch):
    path = written(tmp_path, pushed(ROBOT, run, np.array([12.0, -9.0, 0.0]), 43.0, 44.2))
    other = noisy(swing(ROBOT, "other", seed=3, rate=250.0), np.random.default_rng(1), 0.01)
    parts, whole = (identify(ROBOT, [it, other]) for it in (in_parts(monkeypatch, path), read_recording(path, ROBOT)))
    assert parts.bands == whole.bands
    (event,), (same,) = parts.events, whole.events
    assert (event.recording, event.kind, {*event.joints}) == (same.recording, same.kind, {*same.joints})
    assert (event.start, event.stop) == pytest.approx((43.0, 44.2), abs=0.1)
    # Each part has its own noise, by which an end may be a bin earlier or later, and what is left out of the fit with it; and
    # which of two joints shows it more.
    assert (event.start, event.stop) == pytest.approx((same.start, same.stop), abs=1.01 * BIN)
    assert np.all(np.abs(parts.estimate.value - whole.estimate.value) < 0.1 * whole.estimate.std)
    assert [item.name for item in parts.training.each] == ["swing_1", "other"]


def test_what_is_held_does_not_grow_and_all_samples_count_though_few_are_kept(run, tmp_path, monkeypatch):
    path = written(tmp_path, run)
    whole = identify(ROBOT, path, bands=BANDS)
    monkeypatch.setattr(long_file, "KEPT_SAMPLES", 4_500)
    monkeypatch.setattr(long_file, "WINDOWS", 3)
    monkeypatch.setattr(long_recordings, "MAX_BLOCKS", 20)
    kept = in_parts(monkeypatch, path)
    assert len(kept.time) == 4_500
    parts = identify(ROBOT, kept, bands=BANDS)
    assert 20 <= parts.training.blocks <= 40 < whole.training.blocks
    assert max(rows.table.shape[1] for rows in parts.training.joints) <= 40 * (15 + 1)
    assert parts.estimate.value == pytest.approx(whole.estimate.value, rel=1e-9)
    assert sum(rows.independent for rows in parts.training.joints) == sum(r.independent for r in whole.training.joints)
    assert parts.training.samples == whole.training.samples
    # Of 30 longer blocks a standard deviation is known to about an eighth.
    assert parts.estimate.std == pytest.approx(whole.estimate.std, rel=0.6)
    assert any("of its 15000 samples 4500 are used, in 3 windows" in note for note in parts.notes)


def test_a_remark_on_several_joints_of_a_part_is_of_one_part(run, tmp_path, monkeypatch):
    """What was said of two joints of one part was said to be in two of four parts."""
    turned = run.position.copy()
    turned[:, 9_100:9_150] += 2.0 * np.pi
    path = written(tmp_path, replace(run, position=turned))
    monkeypatch.setattr(long_file, "KEPT_SAMPLES", 4_500)
    monkeypatch.setattr(long_file, "WINDOWS", 3)
    found = identify(ROBOT, in_parts(monkeypatch, path), bands=BANDS)
    (note,) = (note for note in found.notes if "whole turn" in note)
    assert "in 1 of 4 parts: joint1.position jumps by a whole turn" in note


def test_a_part_that_cannot_be_used_is_left_out_and_named(run, tmp_path, monkeypatch):
    broken = run.position.copy()
    broken[0, 9_000:9_500] = np.nan
    path = written(tmp_path, replace(run, position=broken))
    with pytest.raises(RecordingError, match="row 9001"):
        read_recording(path, ROBOT)
    monkeypatch.setattr(long_file, "KEPT_SAMPLES", 4_500)
    monkeypatch.setattr(long_file, "WINDOWS", 3)
    found = identify(ROBOT, in_parts(monkeypatch, path), bands=BANDS)
    assert any("row 9001" in note and "left out, 1 of 4 parts" in note for note in found.notes)
    assert found.training.samples == 15_000 - 3_750
    assert any("are from the 11250 samples" in note for note in found.notes)
    useless = written(tmp_path, replace(run, name="useless", position=np.full_like(broken, np.inf)))
    with pytest.raises(RecordingError, match=r"useless\.parquet: joint1\.position is empty"):
        in_parts(monkeypatch, useless)


@pytest.mark.slow
def test_offsets_of_long_files_are_noise_too(tmp_path, monkeypatch):
    """Of three files, each with an offset of its own, a first moment was 6.5 standard deviations off, and a note ended in an error."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    monkeypatch.setattr(long_file, "LONGEST_WHOLE", 1_000)
    monkeypatch.setattr(long_file, "KEPT_SAMPLES", 4_000)
    monkeypatch.setattr(long_file, "WINDOWS", 2)
    found = {}
    for size in (0.0, 1.0):
        runs = []
        for k, offset in enumerate((-1.0, 0.2, 0.7)):
            made = noisy(swing(robot, f"m{k}_1", k, 40.0, 250.0), np.random.default_rng(k), 0.05)
            path = tmp_path / f"{made.name}.parquet"
            write_recording(replace(made, effort=made.effort + size * offset), path)
            runs.append(read_recording(path, robot))
        assert all(run.long is not None for run in runs)
        found[size] = identify(robot, runs, model="basic", bands=BANDS)
    steady, zeroed = (found[size].estimate for size in (0.0, 1.0))
    bodies = [k for k, name in enumerate(steady.model.names) if not name.startswith("p_o")]
    assert np.all(np.abs((zeroed.value - steady.value) / steady.std)[bodies] < 1.0)
    assert zeroed.std[bodies] == pytest.approx(steady.std[bodies], rel=0.5)
    assert not any("bounds" in note for note in found[1.0].notes)
