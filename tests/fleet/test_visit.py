"""What one arm shows on one date, and that its factors say what its rows do."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from scara_ident.estimation.information import Information, joint_noise, triangular, weighted
from scara_ident.fleet.folder import RecordingFile
from scara_ident.fleet.visit import _visit, look, watched
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.recording import long_file
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, write_urdf
from tests.estimation.test_run_offsets import zeroed_runs
from tests.fleet.made import DATES

ROBOT = pickle.dumps(load_robot())


def file_of(folder: Path, arm: str = "arm1", date: str = DATES[0], name: str = "OJD_1.parquet") -> RecordingFile:
    return RecordingFile(arm, date, f"{date}/{name}", str(folder / arm / date / name))


def test_a_visit_says_what_identify_says_and_its_factors_hold_the_model(folder, histories):
    visit = histories[0].visits[0]
    recording = read_recording(folder / "arm1" / DATES[0] / "OJD_1.parquet", load_robot())
    result = identify(load_robot(), [recording])
    np.testing.assert_array_equal(visit.value, result.estimate.value)
    np.testing.assert_array_equal(visit.std, result.estimate.std)
    assert visit.reference.bands == result.bands
    for own, factor, rows in zip(visit.columns, visit.factors, result.training.joints, strict=True):
        model = own < len(visit.value)
        table = np.vstack([rows.table[:-1], rows.table[-1:]])
        known = np.append(model, True)
        np.testing.assert_allclose((factor.T @ factor)[np.ix_(known, known)], table @ table.T, rtol=1e-9, atol=1e-9)


def test_all_dates_of_an_arm_are_looked_at_in_the_same_bands_with_the_same_columns(histories):
    for history in histories:
        assert len({visit.reference.bands for visit in history.visits}) == 1
        assert len({tuple(map(len, visit.columns)) for visit in history.visits}) == 1


def test_each_effect_is_watched_in_one_form_but_every_order_for_itself(histories):
    scene = histories[0].scene
    found = [(item.effect.name, item.member.joint, item.member.nonlinear) for item in watched(scene)]
    assert len(found) == len(set(found))
    alone = [(name, joint) for name, joint, _ in found if name != "torque_ripple"]
    assert len(alone) == len(set(alone))
    assert {name for name, _ in alone} == {"transmission_loss", "base_tilt", "spring"}
    assert len([name for name, *_ in found if name == "torque_ripple"]) > 4


@pytest.mark.parametrize("content", [b"", b"PAR1 and no more", b"time,joint1.position\n0,1\n"])
def test_a_file_that_cannot_be_read_is_a_fault_and_the_others_are_used(folder, tmp_path, content):
    good = file_of(folder)
    suffix = ".csv" if content.startswith(b"time") else ".parquet"
    (tmp_path / f"bad{suffix}").write_bytes(content)
    bad = RecordingFile("arm1", DATES[0], f"bad{suffix}", str(tmp_path / f"bad{suffix}"))
    visit, faults = look(ROBOT, "complete", [bad, good])
    assert visit is not None and faults == ()
    assert [fault.file for fault in visit.faults] == [bad.place]
    assert str(tmp_path) not in visit.faults[0].why and not visit.faults[0].passing
    visit, faults = look(ROBOT, "complete", [bad])
    assert visit is None and len(faults) == 1


def test_what_is_not_there_may_be_there_another_time(folder):
    gone = file_of(folder, name="gone_1.parquet")
    visit, (fault,) = look(ROBOT, "complete", [gone])
    assert visit is None and "cannot be read" in fault.why


def test_an_arm_that_does_not_move_is_a_fault(folder, tmp_path):
    recording = tmp_path / "still.csv"
    lines = ["time,joint1.position,joint2.position,joint1.effort,joint2.effort"]
    recording.write_text("\n".join([*lines, *(f"{0.005 * k},0.1,0.2,0.0,0.0" for k in range(400))]))
    visit, (fault,) = look(ROBOT, "complete", [RecordingFile("a", "2026-01-01", "still.csv", str(recording))])
    assert visit is None and fault.file is None and "a, 2026-01-01" in fault.why


def test_a_long_file_is_a_visit_too(folder, histories, monkeypatch):
    for name, size in {
        "MAX_SAMPLES": 500,
        "PART_SAMPLES": 1_000,
        "KEPT_SAMPLES": 1_000,
        "WINDOWS": 2,
        "LONGEST_WHOLE": 1_000,
    }.items():
        monkeypatch.setattr(long_file, name, size)
    visit, faults = look(ROBOT, "complete", [file_of(folder)], histories[0].visits[0].reference)
    assert (faults, visit is not None) == ((), True)


@pytest.mark.slow
def test_offsets_of_runs_are_no_gravity_of_a_date(tmp_path):
    """Each date's own would be a change of the arm from one date to the next."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    model, visit = build_model(robot, "basic"), None
    for date in range(3):
        visit = _visit(model, zeroed_runs(robot, 0.5, date), None if visit is None else visit.reference)
        whole, size = [], len(visit.value)
        for own, factor in zip(visit.columns, visit.factors, strict=True):
            part = np.append(own < size, True)
            whole.append(Information(triangular(factor[:, part]), 1e3).embed(own[own < size], size))
        found = weighted(whole, 1.0 / joint_noise(whole)).solve().value
        np.testing.assert_allclose((found - visit.value) / visit.std, 0.0, atol=0.1)
