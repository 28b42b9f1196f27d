"""Inputs made to do harm, or broken as no program breaks them: nothing outside the output folder, one line each."""

from __future__ import annotations

import os
import re
import shutil
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.cli.main import main
from scara_ident.robot.robot import embedded_urdf
from tests.made_recordings import columns, save

NAMES = ["../../../PWNED", "&lt;script&gt;alert(1)&lt;/script&gt;&#10;" + "x" * 300]
# What the answers to `base --robot` say: the file, and words of it.
DESCRIPTIONS = {
    "joints: {joint1: {effort_gain: 1e-300}}": "joints.joint1.effort_gain: expected a size between 1e-12 and 1e+12",
    "joints: {joint1: {effort_gain: 1e160}}": "joints.joint1.effort_gain: expected a size between 1e-12 and 1e+12",
    "joints: {joint1: {rotor_inertia: -1}}": "joints.joint1.rotor_inertia: input should be greater than or equal to 0",
    f"joints: {{joint1: {{effort_gain: {'9' * 5000}}}}}": "line 2: not YAML: '99999999999999999999' cannot be read (Exceeds",
    f"joints: {{joint1: {{effort_gain: 0x{'f' * 5000}}}}}": "joints.joint1.effort_gain: input should be a",
    "locked: {joint1: 2020-13-45}": "line 2: not YAML: '2020-13-45' cannot be read (month must be in 1..12); correct it",
    f"joints: {'{a: ' * 1000}1{'}' * 1000}": "nested too deeply; a robot.yaml has a few levels",
    'urdf: "a\\0b.urdf"': "a?b.urdf: has a null byte in its name; correct the name",
    'urdf: "a\\ud800.urdf"': "a?.urdf: its name is not text in UTF-8; rename it",
    "urdf: ring.urdf": "ring.urdf: Too many levels of symbolic links",
}


def urdf(old: str = "", new: str = "") -> str:
    """The SCARA03 with its third joint fixed, and a change."""
    text = embedded_urdf().read_text().replace('name="joint3" type="prismatic"', 'name="joint3" type="fixed"')
    assert old in text
    return text.replace(old, new, 1)


def named(name: str) -> str:
    return re.sub(r"<robot name=\"[^\"]*\"", f'<robot name="{name}"', urdf())


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir()}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES, ids=["above", "of a page"])
def test_a_robots_name_leads_nowhere(command, folder: Path, here: Path, name: str):
    (here / "arm.urdf").write_text(named(name))
    (here / "robot.yaml").write_text("urdf: arm.urdf\neffort_side: motor\n")
    place = here / "a" / "b" / "out"
    place.mkdir(parents=True)
    # A link of a result's name is replaced and not followed.
    (here / "theirs").write_text("theirs")
    (place / "identification.json").symlink_to(here / "theirs")
    before = files(here)
    answer = command("identify", folder / "OJD_1.parquet", "--robot", "robot.yaml", "--band", "15", "--output", place)
    assert answer.status == 0
    new = files(here) - before
    assert {Path(path).parent for path in new} == {Path("a/b/out")}
    assert {Path(path).suffix for path in new} == {".urdf", ".xml", ".html", ".png"}
    assert (here / "theirs").read_text() == "theirs"
    assert "<script>alert" not in (place / "report.html").read_text()
    answer = command("inspect", folder / "OJD_1.parquet", "--urdf", "arm.urdf", "--output", "seen")
    assert answer.status == 0
    first, second, third, *_ = (here / "seen" / "robot.yaml").read_text().splitlines()
    assert first[0] == second[0] == "#"
    assert third == 'urdf: "../arm.urdf"'


def test_the_demo_follows_no_link_out_of_its_folder(command, here: Path):
    (here / "theirs").mkdir()
    (here / "out").mkdir()
    (here / "out" / "identify").symlink_to(here / "theirs")
    answer = command("demo", "--output", "out")
    assert answer.status == 1
    assert "out/identify: is a link, but results must stay in out; remove it" in answer.err
    assert files(here) == set()


@pytest.mark.parametrize("text", DESCRIPTIONS, ids=lambda text: text[:40])
def test_a_description_is_refused_in_a_line(command, here: Path, text: str):
    os.symlink("ring.urdf", "ring.urdf")
    start = "" if text.startswith("urdf") else f"urdf: {embedded_urdf()}\n"
    (here / "robot.yaml").write_text(f"{start}{text}\n")
    answer = command("base", "--robot", "robot.yaml")
    assert answer.status == 1
    assert answer.err.startswith("scara-ident: robot.yaml")
    assert DESCRIPTIONS[text] in answer.err
    assert len(answer.err) < 400


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("klingon.urdf", b"<?xml version='1.0' encoding='klingon'?><robot/>", "unknown encoding: klingon); save it in UTF-8"),
        ("seven.urdf", b"<?xml version='1.0' encoding='utf-7'?><robot/>", "multi-byte encodings are not supported); save"),
        ("latin.urdf", "<robot name='é'/>".encode("latin-1"), "latin.urdf, line 1: a letter that is not in UTF-8, 'é' if"),
        ("part.urdf", b"<robot><xacro:property/></robot>", "unbound prefix: line 1, column 7; if it is xacro's, run xacro"),
        ("arm.xacro", b"<robot/>", "arm.xacro: is xacro's; run xacro first and give what it writes"),
        ("mass.urdf", urdf('<mass value="20"', '<mass value="5kg"').encode(), "mass.urdf: not a usable URDF: link 'link1': value of"),
        ("rotor.urdf", urdf(">0.0014<", ">-1<").encode(), "rotor.urdf: transmission of joint1: rotorInertia is -1; expected"),
    ],
    ids=lambda value: value if isinstance(value, str) and value.count(".") == 1 else "",
)  # fmt: skip
@pytest.mark.parametrize(
    "words", ["base", "identify {run}", "simulate OJK", "diagnose {run}", "compare {run}", "excite", "inspect {run}"]
)
def test_every_command_refuses_a_urdf_alike(
    command, folder: Path, here: Path, words: str, name: str, content: bytes, said
):
    (here / name).write_bytes(content)
    given = words.format(run=folder / "OJD_1.parquet").split()
    answer = command(*given, "--urdf" if given[0] == "inspect" and "xacro" not in name else "--robot", name)
    assert answer.status == 1
    assert said in answer.err


def test_names_that_are_not_ascii_and_files_in_other_encodings_are_read(command, here: Path):
    text = re.sub(r"<\?xml.*?\?>", "", urdf()).replace("link1", "linké")
    for encoding in ("latin-1", "utf-16"):
        (here / "arm.urdf").write_bytes(f"<?xml version='1.0' encoding='{encoding}'?>\n{text}".encode(encoding))
        answer = command("base", "--robot", "arm.urdf")
        assert answer.status == 0
        assert "linké" in answer.out


def test_a_name_that_the_terminal_cannot_show_is_written_in_escapes(here: Path, monkeypatch: pytest.MonkeyPatch):
    (here / "arm.urdf").write_text(urdf().replace("link1", "linké"), encoding="utf-8")
    monkeypatch.setattr("sys.stdout", TextIOWrapper(BytesIO(), encoding="ascii"))
    with pytest.raises(SystemExit) as ended:
        main(["base", "--robot", "arm.urdf"])
    assert ended.value.code == 0
    sys.stdout.flush()
    assert b"link\\xe9" in sys.stdout.buffer.getvalue()


@pytest.mark.parametrize("words", ["identify", "diagnose"])
def test_a_copy_of_a_fitted_recording_is_not_held_out(command, folder: Path, here: Path, words: str):
    run = folder / "OJD_1.parquet"
    shutil.copy(run, "copy.parquet")
    os.link("copy.parquet", "hard.parquet")
    os.symlink(run, "link.parquet")
    table = pl.read_parquet(run)
    table[500:1500].with_columns(pl.col("time") + 4.0).write_csv("cut.csv")
    for name in ("copy.parquet", "hard.parquet", "link.parquet", "cut.csv"):
        answer = command(words, run, "--validate", name)
        assert answer.status == 2
        assert answer.err.startswith(f"scara-ident: {name}: ")
        assert "given to fit and to validate; a validation recording must be held out" in answer.err


def test_rings_of_links_and_names_that_are_no_text_are_refused(command, here: Path):
    for name in ("ring.csv", "ring.urdf", "ring.yaml", "rings/ring.csv", "ring"):
        (here / name).parent.mkdir(exist_ok=True)
        os.symlink(Path(name).name, name)
    for words, said in {
        "identify ring.csv": "ring.csv: a link that leads to no file",
        "identify rings": "rings/ring.csv: cannot be read: too many levels of symbolic links",
        "base --robot ring.urdf": "cannot read",
        "base --robot ring.yaml": "ring.yaml: cannot be read: Too many levels of symbolic links",
        "base --output ring/out": "results cannot be written here: Too many levels of symbolic links",
    }.items():
        answer = command(*words.split())
        assert answer.status in (1, 2)
        assert said in answer.err
    save(here / "good.csv", columns(1200))
    strange = os.fsdecode(b"run\xff.csv")
    try:
        shutil.copy("good.csv", strange)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    for words in (["identify", strange], ["inspect", strange], ["base", "--output", os.fsdecode(b"out\xff")]):
        answer = command(*words)
        assert answer.status in (1, 2)
        assert "its name is not text in UTF-8; rename it" in answer.err
    for text in ("a\0b", "a\ud800b"):
        for words in (["identify", text], ["base", "--robot", text], ["base", "--output", text], ["simulate", text]):
            assert command(*words).status == 2


def test_a_field_longer_than_the_parser_takes_is_read_or_reported(command, here: Path):
    save(here / "good.csv", columns(1200))
    header, *rows = (here / "good.csv").read_text().splitlines()
    long = "y" * 200_000
    (here / "note_1.csv").write_text(
        "\n".join([f"{header},note", *(f"{row},{long if k == 5 else ''}" for k, row in enumerate(rows))])
    )
    (here / "word_1.csv").write_text("\n".join([header, rows[0], rows[1].replace(",", f",{long}", 1), *rows[2:]]))
    (here / "head_1.csv").write_text("\n".join([f"{header},{long}", *(f"{row},1" for row in rows)]))
    assert command("inspect", "note_1.csv").status == 0
    for name, said in {
        "word_1.csv": "column 'joint1.position', row 2: 'yyyyyyyyyy",
        "head_1.csv": "head_1.csv: its first line is no header (a name of more than 131072 characters); put the column",
    }.items():
        answer = command("identify", name)
        assert answer.status == 1
        assert said in answer.err
        assert len(answer.err) < 250


def test_a_motion_that_no_arm_makes_is_not_simulated(command, here: Path):
    motion = {"time": np.arange(50) / 100} | {
        f"joint{j}.{kind}": np.zeros(50) for j in (1, 2) for kind in ("position", "velocity", "acceleration")
    }
    save(here / "far.csv", motion | {"joint1.velocity": np.where(np.arange(50) < 25, 0.0, 1e29)})
    save(here / "long.csv", motion | {"time": 1e25 * np.arange(50)})
    assert "far: velocity reaches 1e+29, which is impossible for an arm" in command("simulate", "far.csv").err
    assert "long: lasts 4.9e+26 s, more than 10000000 samples at 1000 Hz" in command("simulate", "long.csv").err
    assert files(here) == {"far.csv", "long.csv"}
