"""``scara-ident inspect``: from a file and a URDF to a robot.yaml, whole or not at all."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from scara_ident.cli.main import run
from scara_ident.robot.robot import embedded_urdf, load_robot
from tests.arms import rnea, sines
from tests.docs.pages import blocks
from tests.made_recordings import save
from tests.recording.files.formats import recorded, write_bag, write_plotjuggler
from tests.shared import ROOT, shared_path

MADE = recorded(600)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_plotjuggler(tmp_path / "log_1.csv", MADE)


def answer(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    status = run(["inspect", *map(str, words)])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_a_file_alone_is_listed(log, capsys):
    status, out, err = answer(capsys, log)
    assert (status, err) == (0, "")
    assert "/joint_states/joint1/position" in out
    assert "--urdf" in out


def test_a_first_description_is_written_and_never_overwritten(log, tmp_path, capsys):
    place = tmp_path / "new" / "place"
    status, out, _ = answer(capsys, log, "--urdf", embedded_urdf(), "--output", place)
    assert status == 0
    assert "position of joint1, rad" in " ".join(out.split())
    assert [path.name for path in place.iterdir()] == ["robot.yaml"]
    mine = "# mine\n"
    (place / "robot.yaml").write_text(mine)
    status, out, err = answer(capsys, log, "--urdf", embedded_urdf(), "--output", place)
    assert (status, out) == (1, "")
    assert "exists already" in err
    assert err.count("\n") == 1
    assert (place / "robot.yaml").read_text() == mine
    assert [path.name for path in place.iterdir()] == ["robot.yaml"]


def test_json_on_stdout_is_all_there_is(log, capsys):
    status, out, err = answer(capsys, log, "--urdf", embedded_urdf(), "--json")
    assert (status, err) == (0, "")
    content = json.loads(out)
    assert content["recording"]["time"] == {"column": "__time", "unit": "s"}
    assert content["audit"]["samples"] == 600
    assert content["audit"]["findings"] == []
    assert {column["name"]: column["unit"] for column in content["columns"]}["/joint_states/joint2/position"] == "rad"


def test_long_names_leave_room_for_what_they_are_taken_for(tmp_path, capsys):
    """Beside names of 34 letters it was written in a column of five, and a log of 36 columns took 400 lines."""
    names = {"joint1": "ArmLsixthoutput_Joint", "joint2": "ArmLseventh_Joint"}
    urdf = tmp_path / "arm.urdf"
    text, made = embedded_urdf().read_text(), {"time": MADE["time"]}
    for joint, name in names.items():
        text = text.replace(f'"{joint}"', f'"{name}"')
        for quantity, column in (("position", "q"), ("effort", "tau_measured")):
            made[f"{column}_{name}"] = 1e-4 * np.asarray(MADE[f"{joint}.{quantity}"])
    urdf.write_text(text)
    status, out, _ = answer(capsys, save(tmp_path / "log.csv", made), "--urdf", urdf)
    assert status == 0
    listed = out.split("note:")[0].splitlines()
    assert all(len(line) <= 80 for line in listed)
    # No word is broken but a name's.
    assert all(f"{name}," in " ".join(listed) for name in names.values())
    assert len(listed) < 4 * len(made)


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (("absent.csv",), 2, "no such file"),
        (("log_1.csv", "--output", "out"), 2, "--urdf"),
        (("log_1.csv", "--urdf", "absent.urdf", "--output", "out"), 2, "absent.urdf"),
        (("log_1.csv", "--urdf", "log_1.csv", "--output", "out"), 1, "not well-formed XML"),
        (("log_1.csv", "--robot", "absent.yaml"), 2, "no such robot description"),
        (("empty.mat",), 1, "empty"),
        (("log_1.csv", "--urdf", "U", "--output", "log_1.csv"), 1, "log_1.csv"),
        # A mapping that does not fit the file is no success, though all that is in the file is shown.
        (("log_1.csv", "--robot", "other.yaml"), 1, "no column"),
        ((), 2, "FILE"),
    ],
)
def test_wrong_words_and_files_end_in_a_line_and_nothing_written(
    log, tmp_path, capsys, monkeypatch, words, status, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.mat").write_bytes(b"")
    (tmp_path / "other.yaml").write_text(f"urdf: {embedded_urdf()}\neffort_side: motor\n")
    before = sorted(path.name for path in tmp_path.iterdir())
    words = [str(embedded_urdf()) if word == "U" else word for word in words]
    found, _, err = answer(capsys, *words)
    assert found == status
    assert said in err
    assert err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.slow
def test_the_ur10e_goes_from_a_file_and_a_urdf_to_an_identification(tmp_path, capsys):
    urdf, file = shared_path("data", "ur10e", "ur10e.urdf"), shared_path("data", "ur10e", "ident_20s_5harm.parquet")
    assert answer(capsys, file, "--urdf", urdf, "--output", tmp_path)[0] == 0
    # All that is to be stated is the scale of effort, which are currents of the motors.
    text = (tmp_path / "robot.yaml").read_text()
    assert [line for line in text.splitlines() if "# STATE effort_gain, N m per recorded unit" in line]
    for gain in (14.87, 13.26, 11.13, 10.62, 11.03, 11.47):
        text = text.replace("effort_gain: 1.0", f"effort_gain: {gain}", 1)
    (tmp_path / "robot.yaml").write_text(text)
    words = ["identify", str(file), "--robot", str(tmp_path / "robot.yaml"), "--model", "basic", "--band", "8"]
    assert run([*words, "--method", "consistent", "--output", str(tmp_path / "out")]) == 0
    assert {"report.html", "ur10e_identified.urdf"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert load_robot(tmp_path / "out" / "ur10e_identified.urdf").joints == load_robot(urdf).joints
    content = json.loads((tmp_path / "out" / "identification.json").read_text())
    errors = content["errors"]["training"]["ident_20s_5harm"]
    assert set(errors) == {
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    }
    assert errors["shoulder_lift_joint"]["relative"] < 0.2


@pytest.mark.slow
def test_a_panda_with_its_gripper_goes_from_a_rosbag2_to_a_report_by_the_commands_of_the_page(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    robot = load_robot("panda")
    shutil.copy(robot.urdf, "panda.urdf")
    fingers = ("panda_finger_joint1", "panda_finger_joint2")
    (tmp_path / "logs").mkdir()
    for run_number in (1, 2):
        rng = np.random.default_rng(run_number)
        time = np.arange(800) / 100.0
        q, v, a = sines(rng, time, robot.n, 0.5)
        q += np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.8, 0.0])[:, None]
        effort = rnea(robot, q, v, a) + 0.5 * np.sign(v) + 0.3 * v + 0.05 * rng.standard_normal(q.shape)
        made = {"time": time}
        for joint, position, torque in zip(robot.joints, q, effort, strict=True):
            made |= {f"{joint}.position": position, f"{joint}.effort": torque}
        for finger in fingers:
            made |= {f"{finger}.position": np.full(800, 0.02), f"{finger}.effort": np.zeros(800)}
        write_bag(tmp_path / "logs" / f"run_{run_number}", made, names=(*fingers, *robot.joints))
    page = blocks(ROOT / "docs" / "howto" / "my-logs.md")
    (commands,) = (block.text for block in page if block.language == "sh" and "panda.urdf" in block.text)
    installed, *lines = commands.splitlines()
    assert installed == 'pip install ".[ros]"'
    for command in lines:
        program, *words = shlex.split(command)
        assert program == "scara-ident"
        assert run(words) == 0, capsys.readouterr().err
    described = load_robot("first/robot.yaml")
    assert described.joints == robot.joints
    assert dict(described.locked) == dict.fromkeys(fingers, 0.02)
    assert {"report.html", "panda_identified.urdf"} <= {path.name for path in Path("out").iterdir()}
    content = json.loads(Path("out/identification.json").read_text())
    assert content["urdf_scale"]["panda_joint2"] == pytest.approx(1.0, abs=0.02)
    errors = content["errors"]["validation"]["run_2"]
    # Noise of 0.05 N m, of which a band keeps a part; the arm carries 30 N m.
    assert errors["panda_joint2"]["rms"] < 0.1
    assert load_robot("out/panda_identified.urdf").joints == robot.joints


@pytest.mark.slow
def test_a_mapped_file_identifies_like_the_contracts(tmp_path, log, capsys):
    assert answer(capsys, log, "--urdf", embedded_urdf(), "--output", tmp_path)[0] == 0
    description = tmp_path / "robot.yaml"
    words = ["--model", "basic", "--band", "20"]
    assert run(["identify", str(log), "--robot", str(description), *words]) == 1
    assert "effort_side: missing" in capsys.readouterr().err
    description.write_text(description.read_text().replace("# effort_side: motor", "effort_side: motor"))
    assert run(["identify", str(log), "--robot", str(description), *words, "--output", str(tmp_path / "a")]) == 0
    (tmp_path / "contract").mkdir()
    contract = save(tmp_path / "contract" / "log_1.parquet", MADE)
    assert run(["identify", str(contract), *words, "--output", str(tmp_path / "b")]) == 0
    mapped, plain = (json.loads((tmp_path / k / "identification.json").read_text()) for k in "ab")
    for one, other in zip(mapped["parameters"], plain["parameters"], strict=True):
        # The clock of the CSV is rounded to 0.24 us.
        assert one["value"] == pytest.approx(other["value"], rel=1e-3, abs=1e-2 * other["std"])
