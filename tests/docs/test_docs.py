from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.core import TyperGroup as Group
from typer.main import get_command

import scara_ident
from scara_ident.cli.main import app
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.effects import CATALOGUE
from scara_ident.effects.aliases import HIDDEN
from scara_ident.model.base_parameters import find_base_parameters
from scara_ident.paper import OJD, OJK
from scara_ident.recording.recording import write_recording
from scara_ident.robot.robot import embedded_urdf, load_robot
from scara_ident.simulation import parse_effect, sampled, simulate, virtual_arm
from tests.docs.pages import PAGES, Block, blocks, commands_in, not_printed, run, run_bash, run_here
from tests.shared import ROOT
from tests.test_layers import ROOMS

DOCS = ROOT / "docs"
README = ROOT / "README.md"
TUTORIAL = DOCS / "tutorial.md"
# These are run, and looked at, by tests of their own.
APART = (README, TUTORIAL, DOCS / "howto" / "my-own-effect.md", DOCS / "howto" / "known-payload.md")


# Options of the program itself.
GENERAL = {"--help", "--install-completion", "--show-completion", "--version"}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The reader's folder, which is the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="the documentation is built by Zensical: pip install '.[docs]'")
    # The site is built beside its sources.
    shutil.copytree(DOCS, tmp_path / "docs")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    (tmp_path / "scara_ident").symlink_to(ROOT / "scara_ident")
    done = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=tmp_path, env={**os.environ, "NO_COLOR": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    theory = (tmp_path / "build" / "site" / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math ") > 20
    assert "arithmatex" not in theory
    pages = [page.read_text(encoding="utf-8") for page in (tmp_path / "build" / "site" / "api").glob("*.html")]
    for public in set(scara_ident.__all__) - {"__version__"}:
        home = f"scara_ident.{scara_ident._HOMES[public]}.{public}"
        assert any(f'id="scara_ident.{public}"' in page or f'id="{home}"' in page for page in pages), public


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if page not in APART], ids=name_of)
def test_what_a_page_says_to_type_runs(page: Path, reader: Path) -> None:
    found = blocks(page)
    known = {"bash", "python", "yaml", "toml", "text", "sh"} | {block.language for block in found if block.title}
    assert {block.language for block in found} <= known, "a block that is neither run nor known not to be"
    if any("g++ " in block.text for block in found) and shutil.which("g++") is None:
        pytest.skip("needs a C++ compiler")
    run(page, reader)


@pytest.mark.slow
def test_the_tutorial_finds_what_it_hid(reader: Path) -> None:
    names = run(TUTORIAL, reader)
    diagnosis = json.loads((reader / "out" / "diagnose" / "diagnosis.json").read_text())
    (effect,) = diagnosis["effects"]
    assert (diagnosis["verdict"], effect["effect"], effect["joint"]) == ("explained", "transmission_loss", "joint1")
    assert effect["parameters"]["loss_coefficient"]["value"] == pytest.approx(0.25, rel=0.1)
    held_out = diagnosis["validation"]
    assert held_out["after"]["joint1"] < 0.7 * held_out["before"]["joint1"]
    # As the page says, Coulomb friction had stood in for the loss.
    moved = {row["name"]: row for row in diagnosis["moved"]}
    assert moved["a01"]["after"] < moved["a01"]["before"]
    # The identified URDF is nearer to the true arm than the one that the reader began with, and in itself near.
    base = find_base_parameters(names["robot"])
    mine, identified, true = (
        base.grouping @ robot.standard_parameters()
        for robot in (names["robot"], load_robot(reader / "identified.yaml"), load_robot())
    )
    # All but my2, which is zero.
    mine, identified = ((values - true)[[0, 1, 3, 4]] / true[[0, 1, 3, 4]] for values in (mine, identified))
    assert np.all(np.abs(identified) < 0.05)
    assert np.linalg.norm(identified) < 0.5 * np.linalg.norm(mine)


@pytest.mark.slow
def test_a_users_own_effect_takes_under_20_lines_and_is_found(reader: Path) -> None:
    page = DOCS / "howto" / "my-own-effect.md"
    (own,) = (block for block in blocks(page) if "class CableFriction" in block.text)
    assert sum(bool(line.strip()) for line in own.text.splitlines()) < 20
    found = run(page, reader)["found"]
    (effect,) = found.effects
    assert (found.verdict, effect.effect, effect.joint) == ("explained", "cable_friction", "joint1")
    assert effect.parameters["amplitude"].value == pytest.approx(0.06, rel=0.05)


@pytest.mark.slow
def test_a_known_payload_gives_the_torque_constant(reader: Path) -> None:
    names = run(DOCS / "howto" / "known-payload.md", reader)
    assert names["gain"] == pytest.approx(0.8, rel=0.05)
    assert "common_torque_scale" in {alias.effect for alias in names["found"].aliases}


@pytest.mark.slow
def test_what_the_readme_says_to_type_runs(reader: Path) -> None:
    # The reader's own arm and log, by the names that the README gives them.
    shutil.copy(embedded_urdf(), reader / "my_arm.urdf")
    arm, spring = virtual_arm(), parse_effect("spring:joint1:stiffness=0.045")
    log, another, held_out = (
        simulate(arm, sampled(motion.name, arm.robot, motion.motion, seconds), effects=[spring], seed=seed, rate=250.0)
        for motion, seconds, seed in ((OJD, 12.0, 1), (OJK, 12.0, 2), (OJK, 8.0, 3))
    )
    (reader / "logs").mkdir()
    write_recording(log.recording, reader / "logs" / "run_1.csv")
    # The recordings are made before the block in which they are first used.
    first, second, *rest = blocks(README)
    assert first.prompted.startswith("scara-ident diagnose")
    run_bash("README.md", second.text, reader)
    run(README, reader, done=[second, *rest])
    # From there on they are the reader's own, and shorter.
    for folder, runs in (("train", [log, another]), ("test", [held_out])):
        shutil.rmtree(reader / folder)
        (reader / folder).mkdir()
        for item in runs:
            write_recording(item.recording, reader / folder / f"{item.recording.name}.parquet")
    run(README, reader, done=[first, second])
    assert (reader / "out" / "identify" / "scara03_identified.urdf").is_file()


def test_what_is_printed_is_compared_with_what_is_shown() -> None:
    printed = "scara03: found\nnote: none\nspring on joint1; stiffness 0.0451 ± 2e-04\nN m/rad, 3 runs\n"
    assert not_printed(["spring on joint1; stiffness", "0.0449 ± 1e-04 N m/rad, 3 runs"], printed) is None
    for wrong in (
        "spring on joint2", "stiffness 0.0451 ± 2e-04 N m", "spring on joint1; stiffness 0.0390",
        "spring on joint1; stiffness 0.0451 ± 5e-04", "N m/rad, 4 runs",
    ):  # fmt: skip
        assert not_printed([wrong], printed) == wrong
    assert not_printed(["note: none", "scara03: found"], printed) == "scara03: found"
    block = Block("text", None, "$ scara-ident base \\\n  --robot ur5\n5 base parameters\n", 1)
    assert (block.prompted, block.shown) == ("scara-ident base \\\n  --robot ur5", ["5 base parameters"])


def test_a_block_that_fails_or_prints_something_else_is_a_failure(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"docs/index\.md, line 7: exit status 2"):
        run_bash("docs/index.md, line 7", "scara-ident identfy\necho reached", tmp_path)
    with pytest.raises(AssertionError, match=r"docs/index\.md, line 7: status 2"):
        run_here("docs/index.md, line 7", "scara-ident identfy", tmp_path)
    assert run_here("docs/index.md, line 7", "scara-ident base > base.txt  # to a file", tmp_path) == ""
    assert "P_d1" in (tmp_path / "base.txt").read_text(encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(0.11)\n```\n\n```text\n0.21\n```\n", encoding="utf-8")
    with pytest.raises(AssertionError, match=r"page\.md, line 6: '0\.21' is not printed"):
        run(page, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_that_a_page_names_exists_and_has_its_options(page: Path) -> None:
    program = get_command(app)
    assert isinstance(program, Group)
    assert set(re.findall(r"\bscara-ident ([a-z]+)\b", page.read_text(encoding="utf-8"))) <= set(program.commands)
    for words in commands_in(page):
        options = {option for each in program.commands.get(words[0], program).params for option in each.opts}
        unknown = {word.partition("=")[0] for word in words if word.startswith("--")} - options - GENERAL
        assert not unknown, " ".join(words)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_picture_of_a_page_is_there_and_has_words(page: Path) -> None:
    shown = re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    assert [(words, place) for words, place in shown if not words or not (page.parent / place).is_file()] == []


def test_the_makefile_has_what_pages_say_to_make() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for page in PAGES:
        named = re.findall(r"(?:^|`)make ([a-z]+)(?:`|\s+#|$)", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(named) <= targets, page


def test_the_theory_lists_every_effect() -> None:
    theory = (DOCS / "theory.md").read_text(encoding="utf-8")
    assert [effect.name for effect in CATALOGUE if f"| `{effect.name}` |" not in theory] == []


def test_the_glossary_points_to_modules_that_exist() -> None:
    page = (DOCS / "glossary.md").read_text(encoding="utf-8")
    named = re.findall(r"`([a-z_]+(?:/[a-z_]+)*(?:/|\.py))`", page)
    assert len(named) > 30
    assert [name for name in named if not (ROOT / "scara_ident" / name).exists()] == []


def test_the_architecture_page_lists_every_room_in_order() -> None:
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)/?` \|", page[page.index("## Rooms") :], re.MULTILINE)
    assert listed == [room for room in ROOMS if room != "__main__"]


def test_what_contributors_are_pointed_to_exists() -> None:
    for page in (ROOT / "CONTRIBUTING.md", DOCS / "architecture.md"):
        text = page.read_text(encoding="utf-8")
        named = re.findall(r"`((?:scara_ident|tests|docs|benchmarks)/[\w/.-]+)`", text)
        assert named, page
        assert [name for name in named if not (ROOT / name).exists()] == [], page


def test_version_citation_and_changes_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    latest = re.search(
        r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert latest is not None
    assert {scara_ident.__version__, project["version"], citation["version"], latest[1]} == {project["version"]}
    assert str(citation["date-released"]) == latest[2]


def test_the_pages_of_the_diagnosis_list_every_alias_and_the_limits_of_the_program() -> None:
    page = "".join((DOCS / name).read_text(encoding="utf-8") for name in ("diagnosis.md", "decisions.md"))
    assert [alias.effect for alias in HIDDEN if f"`{alias.effect}`" not in page] == []
    for said in (
        f"| lies outside the model | at least {CRITERIA.min_outside:.0e} ",
        f"| significant | p times candidates tried below {100 * CRITERIA.family_error:g} % |",
        f"| gain in cross-validation | at least {100 * CRITERIA.min_gain:g} % ",
        f"| helps in | at least {100 * CRITERIA.min_votes:g} % ",
        f"| larger than its uncertainty | by {CRITERIA.min_size:g} standard deviations",
        f"| larger than its final uncertainty | by {CRITERIA.min_final_size:g} standard deviations",
        f"at most {100 * CRITERIA.min_colour:g} % of the residual's power within the band",
        f"significant if they removed {100 * CRITERIA.min_power:g} % of",
        f"at most {CRITERIA.worse_held_out:g} times the training error",
        f"explain by over {100 * CRITERIA.remainder_of_runs:g} % of the squared residual (else {100 * CRITERIA.remainder:g} %)",
        f"removes as much as required with p at most {100 * CRITERIA.significant:g} % over all tried",
        f"stands out by at least {100 * CRITERIA.colour_of_remainder:g} %",
        f"At most {CRITERIA.max_effects} effects per joint, and as many of the whole arm",
        f"at least {100 * CRITERIA.min_share:g} % of what it removes",
    ):
        assert said in " ".join(page.split()), said
    assert CRITERIA.alike == 2.0


def test_the_page_of_criteria_has_each_with_its_value_and_unit() -> None:
    page = (DOCS / "criteria.md").read_text(encoding="utf-8")
    for name, value, unit, *_ in CRITERIA.documented():
        assert f"| `{name}` | {value} | {unit} |" in page, name


def test_what_the_readme_says_of_the_diagnosis_adds_up_from_its_page() -> None:
    page = (DOCS / "accuracy.md").read_text(encoding="utf-8")
    table = page[page.index("Added up, ") :].split("\n\n")[1].splitlines()[2:]
    rows = {line.split("|")[1].strip(): [int(n) for n in re.findall(r"\d+", line.split("|", 2)[2])] for line in table}
    # Sets, those with a false effect, right, of, with nothing missing, of these with a false effect.
    first, *further, total, alone = rows.values()
    assert [sum(row[k] for row in further) for k in range(6)] == total[:6]
    assert total[6:] == [
        sum(row[6] for row in further if len(row) == 7),
        sum(row[4] for row in further if len(row) == 7),
    ]
    # Of later programs only the first four.
    later = [
        [int(n) for n in found]
        for found in re.findall(r"^\| (\d+)\b.* \| (\d+) \| (\d+) \| (\d+) of (\d+) \|$", page, re.MULTILINE)
    ]
    nine, last = (
        [sum(column) for column in zip(*(row[1:] for row in later if row[0] // 1000 == start), strict=True)]
        for start in (7, 9)
    )
    # Of one effect above the diagnosis' own limit, and above both; of two and three above both.
    own, both, more = (
        [sum(int(n) for n in found) for found in zip(*re.findall(r"(\d+) of (\d+)", row), strict=True)]
        for row in (
            next(line for line in page.splitlines() if line.startswith(start))
            for start in ("| above what `diagnosis.json`", "| above both, of one", "| each of two above both")
        )
    )
    assert first[2:4] == own
    readme = " ".join(README.read_text(encoding="utf-8").split())
    for said in (
        *(
            f"| {sets} | {arms} | {false} | {right} of {of} |"
            for arms, (sets, false, right, of) in (
                ("SCARA03, UR5, Panda (3711, 3621, 3701)", first[:4]),
                ("SCARA03, UR5, Panda (3801 to 4092)", total[:4]),
                ("nine, six of them new to it (7101 to 7512)", nine),
                ("SCARA03, UR5, Panda, Kinova, xArm7 (9901 to 9973)", last),
            )
        ),
        f"| {alone[0]} | SCARA03, UR5, Panda, nothing missing (3721 to 3723) | {alone[1]} | |",
        f"were found in {both[0]} of {both[1]} sets; two or three effects, each above both limits, were all found in {more[0]} of {more[1]} sets;",
    ):
        assert said in readme, said
