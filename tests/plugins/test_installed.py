"""A package of a stranger, installed by pip: what it adds is there as if it were built in."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from scara_ident import Identification, Recording, identify, load_robot, write_recording
from scara_ident.cli.main import run as run_program
from scara_ident.effects.catalogue import EFFECTS
from scara_ident.identification import ESTIMATORS
from tests.diagnosis.made import BANDS, exact_runs, virtual_runs, with_torque
from tests.docs.pages import blocks
from tests.plugins.made import make_installed
from tests.shared import PATIENCE, ROOT

pytestmark = pytest.mark.slow

Program = Callable[..., "subprocess.CompletedProcess[str]"]


def program_beside(place: Path) -> Program:
    """The command where the packages of a folder are installed too."""

    def call(*words: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "scara_ident", *map(str, words)], capture_output=True, text=True, check=False,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (place, ROOT)))}, timeout=PATIENCE,
        )  # fmt: skip

    return call


@pytest.fixture
def program_here(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Iterator[Callable[[Path], Program]]:
    """The same in this process, which has loaded what each command would load anew."""

    def look_again() -> None:
        for names in (EFFECTS, ESTIMATORS):
            names.refresh()

    def beside(place: Path) -> Program:
        monkeypatch.syspath_prepend(str(place))
        look_again()

        def call(*words: str | Path) -> subprocess.CompletedProcess[str]:
            capfd.readouterr()
            status = run_program([str(word) for word in words])
            said = capfd.readouterr()
            return subprocess.CompletedProcess(words, status, said.out, said.err)

        return call

    yield beside
    monkeypatch.undo()
    look_again()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="needs the extra test: pip install '.[test]'")
    place = tmp_path_factory.mktemp("site")
    source = shutil.copytree(Path(__file__).parent / "arm_lab", tmp_path_factory.mktemp("source") / "arm_lab")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    options = ["--no-index", "--no-deps", "--no-build-isolation", "--target", str(place)]
    done = subprocess.run([*pip, *options, str(source)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture(scope="module")
def program(site: Path) -> Program:
    return program_beside(site)


def write_lab(recording: Recording, path: Path) -> Path:
    """Write a recording as the stranger's logger does."""
    names = ["time", *(f"{joint}.{signal}" for signal in ("position", "effort") for joint in recording.joints)]
    table = np.vstack([recording.time, recording.position, recording.effort])
    np.savetxt(path, table.T, header=" ".join(names))
    return path


def values(found: Identification) -> list[float]:
    return found.estimate.value.tolist()


def test_a_file_of_its_own_suffix_is_read_as_any_other(program: Program, tmp_path: Path):
    run = virtual_runs()[0]
    done = program("identify", write_lab(run, tmp_path / "lab_1.lab"), "--band", "11", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = [row["value"] for row in json.loads(done.stdout)["parameters"]]
    np.testing.assert_allclose(found, values(identify(load_robot(), [run], bands=BANDS)), rtol=1e-9)


def test_its_method_is_a_choice_of_the_command_line(
    program_here: Callable[[Path], Program], site: Path, tmp_path: Path
):
    runs = virtual_runs()[:3]
    for run in runs:
        write_recording(run, tmp_path / f"{run.name}.parquet")
    done = program_here(site)("identify", tmp_path, "--method", "median", "--band", "11", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    content = json.loads(done.stdout)
    alone = [values(identify(load_robot(), [run], method="ols", bands=BANDS)) for run in runs]
    assert content["method"] == "median"
    np.testing.assert_allclose([row["value"] for row in content["parameters"]], np.median(alone, axis=0), rtol=1e-9)


def test_its_effect_is_found_and_shown_in_the_report(program: Program, tmp_path: Path):
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(6.0 * motion.q[1]))
    for run in runs:
        write_recording(run, tmp_path / f"{run.name}.parquet")
    options = ["--effects", "cogging,spring", "--band", "11", "--output", tmp_path / "out"]
    done = program("diagnose", tmp_path, *options)
    assert (done.returncode, done.stderr) == (0, "")
    content = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    (effect,) = content["effects"]
    assert (content["verdict"], effect["effect"], effect["joint"]) == ("explained", "cogging", "joint2")
    assert {row["effect"] for row in content["candidates"]} <= {"cogging", "spring"}
    found = effect["parameters"]
    assert abs(found["periods"]["value"] - 6.0) < 4.0 * found["periods"]["std"]
    assert abs(found["sine"]["value"] - 0.03) < 4.0 * found["sine"]["std"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert "magnets pull joint2 to 6 positions per turn" in page
    assert 'data-figure="effect-1-view"' in page
    assert '"label":"joint2 over position"' in page


def test_help_and_messages_list_what_it_adds(program: Program, tmp_path: Path):
    assert "ols, wls, rls, consistent, median" in " ".join(program("identify", "--help").stdout.split())
    unknown = program("compare", "x", "--method", "mean")
    assert unknown.returncode == 2
    assert (
        unknown.stderr
        == "scara-ident: method 'mean': did you mean median? expected one of ols, wls, rls, consistent, median\n"
    )
    (tmp_path / "run.txt").write_text("0\n")
    assert ".bag or .lab file" in program("identify", tmp_path / "run.txt").stderr


def test_the_page_about_it_shows_this_package():
    (shown,) = (block for block in blocks(ROOT / "docs" / "howto" / "my-own-package.md") if block.language == "toml")
    own = (Path(__file__).parent / "arm_lab" / "pyproject.toml").read_text().splitlines()
    lines = [line for line in shown.text.splitlines() if line]
    assert len(lines) > 8
    assert [line for line in lines if line not in own] == []


def test_a_broken_package_harms_only_who_asks_for_it(program_here: Callable[[Path], Program], tmp_path: Path):
    make_installed(
        tmp_path, "broken", "scara_ident.estimators", {"mean": "broken:mean", "ols": "broken:ols"}, "1 / 0\n"
    )
    recording = tmp_path / "F1_1.parquet"
    write_recording(virtual_runs()[0], recording)
    done = program_here(tmp_path)("identify", recording, "--method", "mean")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "method 'mean' of the package broken cannot be loaded (ZeroDivisionError: " in done.stderr
    done = program_beside(tmp_path)("identify", recording, "--method", "ols")
    note = "scara-ident: note: method 'ols' of the package broken is not used: the name is built in\n"
    assert (done.returncode, done.stderr) == (0, note)


BROKEN = """
import numpy as np
from scara_ident.effects import Coefficient, Effect

class Pole(Effect):
    name = "pole"
    summary = "pole"
    coefficients = (Coefficient("size", "{torque}", "of a pole"),)

    def signal_columns(self, signals, member):
        return [1.0 / (0.0 * signals.motion.q[member.place])]
"""


def test_an_effect_whose_arithmetic_fails_is_an_error_of_a_line_where_asked_for_and_else_a_note(
    program_here: Callable[[Path], Program], tmp_path: Path
):
    make_installed(tmp_path, "poles", "scara_ident.effects", {"pole": "poles:Pole"}, BROKEN)
    runs = [str(tmp_path / f"{run.name}.parquet") for run in virtual_runs()]
    for run, path in zip(virtual_runs(), runs, strict=True):
        write_recording(run, Path(path))
    program = program_here(tmp_path)
    said = "pole of joint1, joint2 cannot be tried: its columns are not finite on any recording; correct the effect"
    done = program("diagnose", *runs, "--band", "11", "--effects", "spring,pole")
    assert (done.returncode, done.stderr) == (1, f"scara-ident: effect {said} or leave this effect out\n")
    done = program("diagnose", *runs, "--band", "11", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    content = json.loads(done.stdout)
    assert said in content["notes"]
    assert "pole" not in {row["effect"] for row in content["candidates"]}
