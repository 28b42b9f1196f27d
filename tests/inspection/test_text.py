"""The first description of an arm reads the file it was made from."""

from __future__ import annotations

import yaml

from tests.arms import Link, write_urdf
from tests.inspection.made import MADE, assert_same, inspected, read_back
from tests.made_recordings import save
from tests.recording.files.formats import write_plotjuggler


def test_the_contracts_columns_need_no_mapping(tmp_path):
    found = inspected(save(tmp_path / "a.parquet", MADE), tmp_path)
    assert found.problems == ()
    assert found.mapping == {}
    assert found.recording is not None
    assert found.recording.findings == ()
    assert {column.name: (column.quantity, column.joint) for column in found.columns}["joint2.effort"] == (
        "effort",
        "joint2",
    )
    assert_same(read_back(found, tmp_path), tmp_path)


def test_the_side_of_effort_is_asked_for_where_there_are_gears(tmp_path):
    urdf = write_urdf(tmp_path / "arm.urdf", (Link(), Link(), Link()), (100.0, -50.5, 1.0))
    made = {name.replace("joint", "j"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path, urdf)
    content = yaml.safe_load(found.description or "")
    assert "effort_side" not in content
    assert "# effort_side: motor" in (found.description or "")
    assert [joint["reduction"] for joint in content["joints"].values()] == [100, -50.5]
    assert content["locked"] == {"j3": 0.0}
    assert any("j3: taken as locked" in note for note in found.notes)


def test_plotjugglers_export_maps_by_one_pattern_a_signal(tmp_path):
    found = inspected(write_plotjuggler(tmp_path / "log.csv", MADE), tmp_path)
    assert found.mapping["time"] == {"column": "__time", "unit": "s"}
    assert found.mapping["position"] == {"column": "/joint_states/{joint}/position", "unit": "rad"}
    assert found.mapping["velocity"] == {"column": "/joint_states/{joint}/velocity", "unit": "rad/s"}
    assert found.recording is not None
    assert_same(read_back(found, tmp_path), tmp_path)


def test_a_rotor_that_the_urdf_does_not_state_is_asked_for_with_a_guess(tmp_path):
    urdf = write_urdf(tmp_path / "arm.urdf", (Link(), Link()), (100.0, -50.0))
    made = {name.replace("joint", "j"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path, urdf)
    text = found.description or ""
    assert "# STATE rotor_inertia, kg m^2" in text
    # Motors for 50 N m at the joint: 1.5e-4 (0.5)^1.2, and 1.5e-4 (1.0)^1.2.
    lines = [line for line in text.splitlines() if line.startswith("  j")]
    for line, value in zip(lines, ("6.5e-05", "1.5e-04"), strict=True):
        assert line.endswith(
            f"# STATE effort_gain, N m per recorded unit; rotor_inertia: {value} from the effort limit"
        )
    # A guess states nothing.
    assert all("rotor_inertia" not in joint for joint in yaml.safe_load(text)["joints"].values())


def test_no_rotor_is_asked_for_where_the_urdf_states_all(tmp_path):
    assert "rotor_inertia" not in (inspected(save(tmp_path / "a.parquet", MADE), tmp_path).description or "")


def test_a_share_of_the_rated_torque_asks_for_that_torque(tmp_path):
    made = {name.replace("effort", "torque_percent"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert found.mapping["effort"] == {"column": "{joint}.torque_percent", "unit": "%"}
    assert "# STATE effort_gain, N m at 100 %" in (found.description or "")
    assert found.recording is not None
