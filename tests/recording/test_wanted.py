"""Columns that are not there are named with what there is and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.wanted import encoding_finding, optional_channels, refuse_missing
from scara_ident.robot.signal_map import contract_channels

CHANNELS = contract_channels(("j1", "j2"))
WANTED = ["time", "j1.position", "j2.position"]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["time", "j1.position", "J2.Position"], "is it 'J2.Position'[?].*rename the column"),
        (
            [f"column_{k}" for k in range(1, 6)],
            "first line holds numbers; .*or map column_1 to column_5 under recording:",
        ),
        (["j1.position", "j2.position"], "no column 'time'; .*or state the rate of even rows.*{time: {rate: 100}}"),
    ],
)
def test_a_missing_column_has_a_remedy(names: list[str], said: str):
    with pytest.raises(RecordingError, match=said):
        refuse_missing(Path("a.csv"), names, WANTED, CHANNELS)


def test_an_encoding_that_the_file_does_not_say_is_said(tmp_path: Path):
    path = tmp_path / "a.csv"
    for encoding, said in (("utf-8", 0), ("utf-16", 0), ("cp1252", 1)):
        path.write_bytes("time;Säule\n0;1\n".encode(encoding))
        assert [finding.kind for finding in encoding_finding(path)] == said * ["encoding"]
    assert encoding_finding(tmp_path / "a.parquet") == []


def test_what_is_to_be_run_names_the_file_where_it_is_and_no_column_of_another_joint_is_the_one():
    names = ["time", "joint1.position", "joint1.effort", "joint2.position"]
    channels = contract_channels(("joint1", "joint2"))
    with pytest.raises(RecordingError) as told:
        refuse_missing(Path("my runs/A_1.csv"), names, [*names, "joint2.effort"], channels)
    assert "no column 'joint2.effort'; its effort columns: joint1.effort;" in str(told.value)
    assert "scara-ident inspect 'my runs/A_1.csv' --urdf URDF" in str(told.value)


def test_a_signal_of_some_joints_only_is_left_out_and_said():
    found, (said,) = optional_channels(Path("a.csv"), CHANNELS, ["j1.velocity"], ())
    assert found == {}
    assert "no j2.velocity, but other joints" in said.message
