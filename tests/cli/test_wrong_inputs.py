"""What is wrong is answered in one line with an exit status, and nothing is lost or half-written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from scara_ident.cli.main import app
from tests.cli.wrong_inputs import make_wrong_files

RESULTS = (
    "identification.json", "diagnosis.json", "comparison.json", "base.json", "paper.json", "excitation.json",
    "trajectory.csv", "report.html", "path_1.parquet", "path_1.truth.json", "robot.yaml",
)  # fmt: skip

# Command line, exit status, and words of the answer: what is wrong, where, what to do.
RECORDINGS = [
    ("missing.csv", 2, ("missing.csv: no such file",)),
    ("none_*.csv", 2, ("none_*.csv: no file matches",)),
    ("nothing", 1, ("nothing: no .parquet or .csv file in this folder", "name one that holds recordings")),
    ("n*g", 1, ("n*g: matches 1 files but no .parquet or .csv file",)),
    ("empty_1.csv", 1, ("empty_1.csv: the file is empty", "record it again")),
    ("empty_1.parquet", 1, ("empty_1.parquet: the file is empty", "record it again")),
    ("header_1.csv", 1, ("header_1.csv: 0 usable samples", "record for longer")),
    ("one_1.csv", 1, ("one_1.csv: 1 usable samples", "record for longer")),
    ("text_1.csv", 1, ("text_1.csv: column 'joint1.position', row 2", "is not a number", "correct it")),
    ("numbers_1.csv", 1, ("numbers_1.csv: the first line holds numbers", "put the column names there")),
    ("long_1.csv", 1, ("long_1.csv: row 1 has 6 values for 5 columns", "correct or remove")),
    ("twice_1.csv", 1, ("twice_1.csv: column 'joint1.effort' is in the header twice", "rename one")),
    ("no_text_1.csv", 1, ("no_text_1.csv: not a text file in UTF-8, UTF-16 or Windows-1252", "save the CSV again")),
    ("cut_1.parquet", 1, ("cut_1.parquet: not a whole parquet file", "copy or record it again")),
    ("log.txt", 1, ("log.txt: suffix '.txt' is not known", ".parquet, .csv")),
    ("picture.png", 1, ("picture.png: suffix '.png' is not known", ".parquet, .csv")),
    ("garbage.mat", 1, ("garbage.mat: not a whole mat file", "copy or record it again")),
    ("other_1.csv", 1, ("other_1.csv: no column 'joint2.position'", "elbow.position", "rename the column")),
    ("dumb_1.csv", 1, ("dumb_1.csv: no column 'joint2.effort'", "rename the column")),
    ("still_1.parquet", 1, ("still_1.parquet: none of 100 samples can be used", "at rest", "moving data")),
    ("dead_1.parquet", 1, ("dead_1.parquet: joint1.effort is 0 throughout", "dead channel", "record it again")),
    ("nan_1.parquet", 1, ("nan_1.parquet: joint1.position", "NaN", "record that channel")),
    ("degrees_1.parquet", 1, ("degrees_1.parquet: joint1.position", "looks like degrees", "convert it to rad")),
    ("milliseconds_1.parquet", 1, ("milliseconds_1.parquet: time", "looks like milliseconds", "divide by 1000")),
    ("nanoseconds_1.parquet", 1, ("nanoseconds_1.parquet: time", "looks like nanoseconds", "divide by 1e+09")),
    ("backwards_1.parquet", 1, ("backwards_1.parquet: time runs backwards at row 2", "sort the rows by time")),
    ("leap_1.parquet", 1, ("leap_1.parquet: time runs backwards at row 601", "sort the rows by time")),
    ("frozen_1.parquet", 1, ("frozen_1.parquet: time never advances", "must be in seconds and grow")),
]
ROBOTS = [
    ("no.yaml", 2, ("no.yaml: no such robot description",)),
    ("ur6", 2, ("ur6: no such file, nor a robot of example-robot-data; did you mean ur5",)),
    ("none.urdf", 2, ("none.urdf: no such file; give a robot.yaml or a URDF",)),
    ("nothing", 1, ("nothing: is a folder", "give its robot.yaml")),
    ("list.yaml", 1, ("list.yaml: expected a mapping", "found list")),
    ("syntax.yaml", 1, ("syntax.yaml, line 2: not YAML",)),
    ("binary.yaml", 1, ("binary.yaml: not a text file", "expected a robot.yaml")),
    ("key.yaml", 1, ("key.yaml: joints.joint1.reductoin: unknown key", "expected one of reduction")),
    ("reduction.yaml", 1, ("reduction.yaml: joints.joint1.reduction: expected a number other than 0",)),
    ("side.yaml", 1, ("side.yaml: effort_side:", "'motor' or 'joint'", "found 'elbow'")),
    ("gravity.yaml", 1, ("gravity.yaml: gravity: expected three numbers in m/s^2",)),
    ("unknown.yaml", 1, ("unknown.yaml: joints.jiont1: the URDF has no such joint", "did you mean joint1?")),
    ("both.yaml", 1, ("both.yaml: locked.joint2: the joint is also under joints", "name it in one of them")),
    ("nourdf.yaml", 1, ("nourdf.yaml: urdf: no such file", "arm_that_is_not_there.urdf")),
    ("syntax.urdf", 1, ("syntax.urdf: not well-formed XML", "line ")),
    ("root.urdf", 1, ("root.urdf: the root element is <sdf>", "a URDF has <robot>")),
    ("rigid.urdf", 1, ("rigid.urdf: joints: none to identify", "no movable joint")),
    ("samename.urdf", 1, ("samename.urdf: not a usable URDF: two joints are named 'joint1'", "rename one")),
    ("samelink.urdf", 1, ("samelink.urdf: not a usable URDF: two links are named 'link1'", "rename one")),
    ("nolink.urdf", 1, ("nolink.urdf: not a usable URDF: joint 'joint2' names 'lnk2'", "correct it")),
    ("nochild.urdf", 1, ("nochild.urdf: not a usable URDF: joint 'joint2' has no child link", "name it")),
    (
        "loop.urdf",
        1,
        ("loop.urdf: not a usable URDF: joint 'joint2': link 'link1' is its parent and its child", "name two"),
    ),
    ("roots.urdf", 1, ("roots.urdf: not a usable URDF: links 'base_link', 'lonely' have no joint to a parent",)),
]
OTHERS = [
    # identify
    ("identify", 2, ("RECORDING", "see scara-ident identify --help")),
    ("identify good_1.parquet --colour", 2, ("No such option: --colour", "see scara-ident identify --help")),
    ("identify good_1.parquet --model full", 2, ("model 'full': expected one of complete, reduced, basic",)),
    ("identify good_1.parquet --method magic", 2, ("method 'magic': expected one of ols, wls, rls, consistent",)),
    ("identify good_1.parquet --band=-3", 2, ("--band", "greater than", "see scara-ident identify --help")),
    ("identify good_1.parquet --band=nan", 2, ("--band", "greater than", "see scara-ident identify --help")),
    ("identify good_1.parquet --band=inf", 2, ("band of joint1 is inf Hz", "expected a frequency above 0")),
    ("identify good_1.parquet --band 1e9", 2, ("1e+09 Hz", "good_1 has 1000 samples per second", "a lower band")),
    ("identify good_1.parquet --band 500", 2, ("band of joint1 is 500 Hz", "less than 500 Hz", "a lower band")),
    ("identify good_1.parquet --friction dry", 2, ("--friction", "'dry' is not one of 'auto'")),
    ("identify good_1.parquet --friction free", 2, ("--friction free: needs --method consistent",)),
    ("identify good_1.parquet --band=wide", 2, ("--band", "number", "see scara-ident identify --help")),
    ("identify good_1.parquet --validate", 2, ("--validate", "requires an argument")),
    ("identify good_1.parquet --validate missing.csv", 2, ("missing.csv: no such file",)),
    ("identify good_1.parquet --validate good_1.parquet", 2, ("good_1.parquet: given to fit and to", "held out")),
    ("identify good_1.parquet --validate day1 --validate ./good_1.parquet", 2, ("good_1.parquet", "held out")),
    # diagnose
    ("diagnose", 2, ("RECORDING", "see scara-ident diagnose --help")),
    ("diagnose missing.csv", 2, ("missing.csv: no such file",)),
    ("diagnose nothing", 1, ("nothing: no .parquet or .csv file in this folder",)),
    ("diagnose text_1.csv", 1, ("text_1.csv: column 'joint1.position', row 2",)),
    ("diagnose good_1.parquet --model full", 2, ("model 'full': expected one of",)),
    ("diagnose good_1.parquet --band 5000", 2, ("band of joint1 is 5000 Hz", "give a lower band")),
    ("diagnose good_1.parquet --effects spring,glue", 2, ("effect 'glue': expected one of transmission_loss",)),
    ("diagnose good_1.parquet --validate good_1.parquet", 2, ("good_1.parquet: given to fit and to", "held out")),
    ("diagnose good_1.parquet --robot reduction.yaml", 1, ("reduction.yaml: joints.joint1.reduction",)),
    # compare
    ("compare missing.csv", 2, ("missing.csv: no such file",)),
    ("compare good_1.parquet", 1, ("at least two trajectories, found 1", "repetitions")),
    ("compare good_1.parquet good_1.csv", 1, ("two recordings named 'good_1'", "rename one")),
    ("compare good_1.parquet --method magic", 2, ("method 'magic': expected one of",)),
    ("compare good_1.parquet day1/run_1.parquet still_1.parquet", 1, ("trajectories, found 1",)),
    # simulate
    ("simulate nowhere.csv", 2, ("'nowhere.csv': no such file", "OJK, OJD")),
    ("simulate OJD5", 2, ("'OJD5': no such file", "OJK, OJD")),
    ("simulate empty_1.csv", 1, ("empty_1.csv: the file is empty",)),
    ("simulate lacking.csv", 1, ("lacking.csv: no column 'joint2.position'", "a trajectory has")),
    ("simulate hole.csv", 1, ("hole: velocity has a value that is not finite", "give a complete motion")),
    ("simulate short.csv", 1, ("short: time must have at least two samples",)),
    ("simulate loop.csv", 1, ("loop: time must have at least two samples and grow strictly",)),
    ("simulate path.csv --effect sprong", 2, ("'sprong': no such effect", "did you mean spring?")),
    ("simulate path.csv --effect spring:joint1:stifness=3", 2, ("has no 'stifness'", "it has stiffness")),
    ("simulate path.csv --effect push:recording=path_2", 2, ("no recording 'path_2'", "there will be path_1")),
    ("simulate path.csv --effect push:link=hand", 1, ("no link 'hand'", "it has")),
    ("simulate path.csv --effect spring:joint1:stiffness=soft", 2, ("stiffness is 'soft'", "expected a number")),
    ("simulate path.csv --effect spring:joint9", 2, ("no joint 'joint9'", "joint1, joint2")),
    ("simulate path.csv --effect spring:", 2, ("'spring:'", "expected NAME:JOINT:KEY=VALUE")),
    ("simulate path.csv --effect base_tilt:joint1", 2, ("base_tilt", "leave out the joint")),
    ("simulate path.csv --effect transmission_loss:loss_coefficient=7", 2, ("loss_coefficient is 7", "expected 0 to")),
    ("simulate path.csv --effect spring --effect spring", 2, ("spring is given twice", "give it once")),
    ("simulate path.csv --repetitions 0", 2, ("--repetitions", "greater than or equal to 1")),
    ("simulate path.csv --seed one", 2, ("--seed", "integer")),
    ("simulate path.csv --seed=-1", 2, ("--seed", "greater than or equal to 0")),
    # excite and demo
    ("excite extra", 2, ("unexpected extra argument", "extra", "see scara-ident excite --help")),
    ("excite --criterion volume", 2, ("--criterion", "'volume' is not one of 'logdet', 'cond'")),
    ("excite --duration=-1", 2, ("--duration", "greater than", "see scara-ident excite --help")),
    ("excite --duration nan", 2, ("--duration", "see scara-ident excite --help")),
    ("excite --duration inf", 2, ("--duration", "less than", "see scara-ident excite --help")),
    ("excite --harmonics 2", 2, ("--harmonics", "greater than or equal to 3")),
    ("excite --rate 0", 2, ("--rate", "greater than")),
    ("excite --seed=-1", 2, ("--seed", "greater than or equal to 0")),
    ("excite --known missing.csv", 2, ("missing.csv: no such file",)),
    ("excite --known dumb_1.csv", 1, ("dumb_1.csv: no column 'joint2.effort'",)),
    ("excite --robot endless.urdf", 1, ("endless.urdf: joint 'joint1' has no position limits", "give <limit")),
    ("demo --seed=-1", 2, ("--seed", "greater than or equal to 0")),
    ("demo extra", 2, ("unexpected extra argument", "see scara-ident demo --help")),
    # what is done with a result
    ("use", 2, ("RESULT", "see scara-ident use --help")),
    ("use missing.json", 2, ("missing.json: no such file; give an identification.json",)),
    ("use text_1.csv", 1, ("text_1.csv: not JSON", "give an identification.json or diagnosis.json")),
    ("check missing.csv missing.json", 2, ("missing.json: no such file",)),
    ("contact good_1.csv missing.json --free good_1.csv", 2, ("missing.json: no such file",)),
    ("export missing.json --to c", 2, ("missing.json: no such file",)),
    ("export missing.json --to word", 2, ("--to", "'word' is not one of 'urdf', 'mjcf'")),
    ("fleet nothing", 1, ("nothing",)),
    ("fleet missing", 2, ("missing: no such folder",)),
    ("ask good_1.csv", 1, ("good_1.csv",)),
    ("excite --tell missing.json", 2, ("missing.json: no such file", "give a diagnosis.json")),
    ("excite --parameters missing.json", 2, ("missing.json: no such file", "give an identification.json")),
    ("use missing.json --robot good_1.csv", 2, ("missing.json: no such file",)),
    # An empty word, as of a variable of the shell that is not set, is not the current folder.
    ("identify good_1.parquet --output=", 2, ("Invalid value for '--output': it is empty; give a value",)),
    ("excite --output=", 2, ("'--output': it is empty",)),
    ("fleet nothing --output=", 2, ("'--output': it is empty",)),
    ("identify good_1.parquet --validate=", 2, ("'--validate': it is empty",)),
    ("base --robot=", 2, ("'--robot': it is empty", "see scara-ident base --help")),
    ("excite --tell=", 2, ("'--tell': it is empty",)),
    # base and paper
    ("base extra", 2, ("unexpected extra argument", "extra", "see scara-ident base --help")),
    ("base --robot", 2, ("--robot", "requires an argument")),
    ("paper --printed", 2, ("--printed", "see scara-ident paper --help")),
    # inspect
    ("inspect", 2, ("FILE", "see scara-ident inspect --help")),
    ("inspect missing.csv", 2, ("missing.csv: no such file",)),
    ("inspect nothing", 2, ("nothing: is a folder", "give one recording")),
    ("inspect log.txt", 1, ("log.txt: suffix '.txt' is not known",)),
    ("inspect cut_1.parquet", 1, ("cut_1.parquet: not a whole parquet file", "copy or record it again")),
    ("inspect garbage.mcap", 1, ("garbage.mcap: not a whole mcap file", "copy or record it again")),
    ("inspect garbage.h5", 1, ("garbage.h5: not a whole h5 file", "copy or record it again")),
    ("inspect garbage.db3", 1, ("garbage.db3: not a whole db3 file", "copy or record it again")),
    ("inspect good_1.csv --urdf syntax.urdf", 1, ("syntax.urdf: not well-formed XML",)),
    ("inspect good_1.csv --urdf syntax.urdf --robot key.yaml", 2, ("--urdf and --robot: give one",)),
    ("inspect good_1.csv --robot key.yaml", 1, ("key.yaml: joints.joint1.reductoin: unknown key",)),
    ("inspect good_1.csv --output new", 2, ("--output", "give --urdf")),
    # the program
    ("identfy good_1.csv", 2, ("'identfy'", "Did you mean 'identify'?")),
    # places that results cannot be written into, found before anything else is looked at
    *(
        (f"{words} --output {place}", 1, (f"{place}: results cannot be written here: is a file", "another folder"))
        for words, place in (
            ("identify missing.csv", "log.txt"),
            ("diagnose missing.csv", "log.txt"),
            ("compare missing.csv", "log.txt/below/it"),
            ("simulate nowhere.csv", "log.txt"),
            ("excite --robot no.yaml", "log.txt"),
            ("demo", "log.txt"),
            ("base --robot no.yaml", "log.txt"),
            ("paper", "log.txt"),
            ("inspect good_1.csv --urdf no.urdf", "log.txt"),
        )
    ),
]
CASES = [
    *((f"identify {words}", *rest) for words, *rest in RECORDINGS),
    *((f"base --robot {words}", *rest) for words, *rest in ROBOTS),
    *OTHERS,
]


@pytest.fixture(scope="session")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wrong")
    make_wrong_files(place)
    return place


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A folder with the results of an earlier run."""
    place = tmp_path / "results"
    place.mkdir()
    for name in RESULTS:
        (place / name).write_text(f"earlier {name}")
    return place


def state(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Every file and folder with its size, its time and its number on the disk."""
    found = {str(path.relative_to(folder)): path.stat() for path in folder.rglob("*")}
    return {name: (of.st_size, of.st_mtime_ns, of.st_ino) for name, of in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize(("words", "status", "said"), CASES, ids=[words for words, *_ in CASES])
def test_a_wrong_input_is_one_line_and_changes_nothing(
    command, wrong: Path, results: Path, monkeypatch: pytest.MonkeyPatch, words: str, status: int, said: tuple[str, ...]
):
    monkeypatch.chdir(wrong)
    given = words.split()
    if "--output" not in words and given[0] not in ("inspect", "identfy", "ask"):
        given[1:1] = ["--output", str(results)]
    before = state(wrong), state(results)
    answer = command(*given)
    assert answer.status == status
    assert answer.out == ""
    for text in said:
        assert text in answer.err
    assert (state(wrong), state(results)) == before


def test_the_table_has_every_command_and_both_statuses():
    commands = {command.name or command.callback.__name__ for command in app.registered_commands}
    tried = {words.split()[0] for words, *_ in CASES}
    assert commands <= tried
    assert {status for _, status, _ in CASES} == {1, 2}
    assert len({words for words, *_ in CASES}) == len(CASES) >= 30


def test_the_files_beside_the_wrong_ones_are_right(command, wrong: Path, monkeypatch: pytest.MonkeyPatch):
    """So that each wrong one is refused for what is wrong with it."""
    monkeypatch.chdir(wrong)
    for words in ("identify good_1.csv --band 15", "inspect good_1.csv", "base"):
        assert command(*words.split()).status == 0


def test_a_joint_that_never_moves_is_said_and_its_parameters_are_left_open(command, wrong: Path, monkeypatch):
    monkeypatch.chdir(wrong)
    answer = command("identify", "stiff_1.parquet", "--band", "15")
    assert answer.status == 0
    said = " ".join(answer.out.split())
    assert "stiff_1: joint2 does not move" in said
    assert "joint2 - at rest -" in said
    assert "The data do not determine P_d1, P_d2, P_d3, P_d4, P_d5, a02, a12, a22, a32, p_o2" in said


@pytest.fixture
def forbidden(tmp_path: Path) -> Iterator[Callable[[], None]]:
    """What takes the rights from the program: root, whom no mode of a file stops, works on as nobody."""
    if os.name != "posix":
        pytest.skip("needs the file modes of POSIX")
    above = [folder for folder in tmp_path.parents if folder.owner() == tmp_path.owner() and folder.name]
    modes = {folder: folder.stat().st_mode for folder in above}
    root = os.geteuid() == 0

    def drop() -> None:
        if root:
            # So that nobody gets as far as the folder of this test.
            for folder, mode in modes.items():
                folder.chmod(mode | 0o011)
            os.seteuid(65534)

    yield drop
    if root:
        os.seteuid(0)
        for folder, mode in modes.items():
            folder.chmod(mode)


def test_a_folder_that_may_not_be_written_to_is_said_before_the_work(command, tmp_path: Path, forbidden):
    place = tmp_path / "theirs"
    place.mkdir(mode=0o555)
    tmp_path.chmod(0o755)
    # Loads what the command needs, which nobody may not read.
    assert command("base", "--output", tmp_path / "mine").status == 0
    forbidden()
    for folder in (place, place / "new"):
        answer = command("base", "--output", folder)
        assert answer.status == 1
        assert f"{folder}: results cannot be written here: Permission denied; give another folder" in answer.err
    assert list(place.iterdir()) == []


def test_files_that_may_not_be_read_are_said(command, wrong: Path, tmp_path: Path, forbidden):
    for name in ("good_1.csv", "good_1.parquet", "key.yaml"):
        (tmp_path / name).write_bytes((wrong / name).read_bytes())
        (tmp_path / name).chmod(0)
    tmp_path.chmod(0o755)
    assert command("inspect", wrong / "good_1.csv").status == 0
    assert command("inspect", wrong / "good_1.parquet").status == 0
    assert command("identify", wrong / "cut_1.parquet").status == 1
    forbidden()
    for words in ("inspect good_1.csv", "identify good_1.parquet", "base --robot key.yaml"):
        *before, name = words.split()
        answer = command(*before, tmp_path / name)
        assert answer.status == 1
        assert f"{tmp_path / name}: cannot be read: permission denied" in answer.err.replace("Permission", "permission")


def test_a_joint_that_is_described_twice_is_refused(command, wrong: Path):
    result = command("base", "--robot", wrong / "again.yaml")
    assert result.status == 1
    assert "again.yaml" in result.err
    assert "joint1" in result.err
    assert "twice" in result.err


@pytest.mark.parametrize("words", ["simulate path.csv --output made", "base --output made/for/it"])
def test_a_folder_that_is_not_there_is_made(command, wrong: Path, tmp_path: Path, monkeypatch, words: str):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.csv").write_bytes((wrong / "path.csv").read_bytes())
    assert command(*words.split()).status == 0
    assert [path for path in (tmp_path / "made").rglob("*") if path.is_file()]


def test_a_folder_is_not_made_for_a_run_that_fails(command, wrong: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(wrong)
    assert command("identify", "text_1.csv", "--output", tmp_path / "new" / "results").status == 1
    assert list(tmp_path.iterdir()) == []
