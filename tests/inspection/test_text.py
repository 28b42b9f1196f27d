"""The first description of an arm reads the file it was made from."""

from __future__ import annotations

import pytest
import yaml

from scara_ident.inspection.inspection import inspect_file
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


@pytest.mark.parametrize("slides", [True, False])
def test_the_reduction_of_a_joint_that_slides_is_asked_for_in_rad_per_metre(tmp_path, slides):
    """Motor turns per joint turn were asked for, and kg m^2 of what is kg."""
    kind = "prismatic" if slides else "revolute"
    urdf = write_urdf(tmp_path / "arm.urdf", (Link(kind), Link()))
    made = {name.replace("joint", "j"): values for name, values in MADE.items()}
    text = " ".join(inspected(save(tmp_path / "a.parquet", made), tmp_path, urdf).description.split("\n# "))
    assert "reduction: motor turns per joint turn" in text
    assert ("of a joint that slides motor rad per metre: 2 pi over a screw's lead" in text) is slides
    assert ("(with reduction 1: seen at the joint, kg where it slides)" in text) is slides


def test_no_rotor_is_asked_for_where_the_urdf_states_all(tmp_path):
    assert "rotor_inertia" not in (inspected(save(tmp_path / "a.parquet", MADE), tmp_path).description or "")


def test_a_share_of_the_rated_torque_asks_for_that_torque(tmp_path):
    made = {name.replace("effort", "torque_percent"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert found.mapping["effort"] == {"column": "{joint}.torque_percent", "unit": "%"}
    assert "# STATE effort_gain, N m at 100 %" in (found.description or "")
    assert found.recording is not None


@pytest.mark.parametrize("name", ["{joint}.{signal}", "{joint}_{signal}"])
def test_a_log_without_a_clock_asks_for_the_rate(tmp_path, name):
    made = {
        name.format(joint=key.split(".")[0], signal=key.split(".")[1]): v for key, v in MADE.items() if key != "time"
    }
    path = save(tmp_path / "a.parquet", made)
    found = inspected(path, tmp_path)
    assert any("state the rate of even rows" in problem for problem in found.problems)
    text = found.description or ""
    assert "# STATE the rate, samples per second" in text
    assert yaml.safe_load(text)
    rate = 1.0 / float(MADE["time"][1] - MADE["time"][0])
    stated = text.replace("# effort_side: joint", "effort_side: joint").replace("# recording:", "recording:")
    stated = stated.replace("#   time:", "  time:").replace("# time:", "time:")
    (tmp_path / "robot.yaml").write_text(stated.replace("rate: 100", f"rate: {rate!r}"), encoding="utf-8")
    again = inspect_file(path, robot=tmp_path / "robot.yaml")
    assert again.refusal is None
    assert again.recording is not None
    assert again.recording.rate == pytest.approx(rate, rel=1e-6)
