"""inspect lists what is in a file and says what it does not know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import RecordingError, UsageError
from scara_ident.inspection.inspection import inspect_file
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import embedded_urdf, load_robot
from tests.inspection.made import MADE, inspected, read_back
from tests.made_recordings import save
from tests.recording.files.formats import write_plotjuggler
from tests.shared import shared_path


def test_texts_and_constants_are_listed_as_such(tmp_path):
    frame = pl.DataFrame(MADE | {"zero": np.zeros(600)}).with_columns(pl.lit("running").alias("mode"))
    frame.write_parquet(tmp_path / "a.parquet")
    kinds = {column.name: column.kind for column in inspected(tmp_path / "a.parquet", tmp_path).columns}
    assert (kinds["mode"], kinds["zero"], kinds["joint1.position"]) == ("text", "constant", "numbers")


def test_what_the_audit_refuses_is_said(tmp_path):
    made = MADE | {"joint1.effort": np.zeros(600)}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert found.recording is None
    assert "dead channel" in (found.refusal or "")


def test_a_description_is_checked_on_a_file(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    found = inspected(path, tmp_path)
    read_back(found, tmp_path)
    again = inspect_file(path, robot=tmp_path / "robot.yaml")
    assert again.recording is not None
    assert again.description is None
    assert [c.joint for c in again.columns if c.channel and c.quantity == "effort"] == ["joint1", "joint2"]


@pytest.mark.parametrize("slow", [1.0, 3.0])
def test_a_clock_that_the_velocities_contradict_is_asked_about(tmp_path, slow: float):
    """Of a log of 6 ms written at 2 ms nothing was said until it was identified, and there velocity alone was doubted."""
    made = MADE | {"time": np.asarray(MADE["time"]) * slow}
    path = save(tmp_path / "a.parquet", made)
    (tmp_path / "robot.yaml").write_text(
        f"urdf: {embedded_urdf()}\neffort_side: motor\njoints: {{joint1: {{}}, joint2: {{}}}}\n"
    )
    found = inspect_file(path, robot=tmp_path / "robot.yaml")
    asked = [note for note in found.notes if "is the unit or rate of time wrong" in note]
    assert len(asked) == (slow != 1.0)


@pytest.mark.parametrize(("factors", "asked"), [((1.0, 1.0), False), ((0.68, 0.68), True), ((0.68, 0.4), False)])
def test_a_first_description_keeps_velocities_that_are_one_multiple_of_the_slopes(
    tmp_path, factors: tuple[float, float], asked: bool
):
    """Of a log of 2.9 ms written at 2 ms the velocity was left out as no slope, and nothing asked for the clock."""
    made = {f"arm {name}": values for name, values in MADE.items() if not name.endswith("velocity")}
    for joint, factor in zip(("joint1", "joint2"), factors, strict=True):
        made[f"arm {joint}.velocity"] = factor * np.asarray(MADE[f"{joint}.velocity"])
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert ("velocity" in found.mapping) is (factors[0] == factors[1])
    assert any("is the unit or rate of time wrong" in note for note in found.notes) is asked
    assert any("not the derivative of the positions in any unit; left out" in note for note in found.notes) is (
        factors[0] != factors[1]
    )


def test_wrong_words_are_bad_usage_and_wrong_files_an_error(tmp_path):
    path = save(tmp_path / "a.parquet", MADE)
    with pytest.raises(UsageError, match="give one"):
        inspect_file(path, urdf="a.urdf", robot="robot.yaml")
    with pytest.raises(UsageError, match="no such file"):
        inspect_file(tmp_path / "absent.csv")
    with pytest.raises(UsageError, match="is a folder"):
        inspect_file(tmp_path)
    (tmp_path / "a.xlsx").write_bytes(b"x")
    with pytest.raises(RecordingError, match="not known"):
        inspect_file(tmp_path / "a.xlsx")


@pytest.mark.parametrize("arm", ["ur10e", "emps", "double_pendulum_c1"])
def test_measured_files_read_by_the_first_description_as_by_the_published_one(tmp_path, arm):
    published = load_robot(shared_path("data", arm, "robot.yaml"))
    file = {"ur10e": "ident_20s_5harm", "emps": "identification", "double_pendulum_c1": "C1_154220"}[arm]
    path = shared_path("data", arm, f"{file}.parquet")
    found = inspect_file(path, urdf=published.urdf, folder=tmp_path)
    assert found.problems == ()
    back = read_back(found, tmp_path)
    # The gain of a drive is what no file says.
    wanted = read_recording(path, replace(published, effort_gain=np.ones(published.n)))
    assert back.joints == wanted.joints
    np.testing.assert_array_equal(back.position, wanted.position)
    np.testing.assert_array_equal(back.effort, wanted.effort)


def test_how_to_identify_a_joint_that_moves_alone_is_reported(tmp_path):
    asked = "joints='joint1' identifies it alone"
    still = MADE | {"joint2.position": np.asarray(MADE["joint2.position"]) * 1e-6}
    for made, told in ((still, True), (MADE, False)):
        found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
        assert any(asked in note for note in found.notes) == told
    alone = inspect_file(tmp_path / "a.parquet", urdf=embedded_urdf(), joints="joint1", folder=tmp_path)
    assert not any("identifies it alone" in note for note in alone.notes)
