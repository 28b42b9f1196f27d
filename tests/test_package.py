"""What is built from the checkout: the wheel carries all that the package reads, and works where no checkout is."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.shared import PATIENCE, ROOT

pytestmark = pytest.mark.slow

PACKAGE = ROOT / "scara_ident"


def tree(top: Path) -> set[str]:
    """Every file of the package but what Python makes of it."""
    files = (path for path in top.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(top.parent).as_posix() for path in files}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    builders = pytest.importorskip("hatchling.builders.wheel", reason="needs the extra test: pip install '.[test]'")
    place = tmp_path_factory.mktemp("wheel")
    (built,) = builders.WheelBuilder(str(ROOT)).build(directory=str(place), versions=["standard"])
    return Path(built)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel's files in a folder of their own, which Python is told to look into first."""
    place = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place)
    return place


def outside(installed: Path, folder: Path, *words: str) -> str:
    """Run Python on the installed files, in a folder that is not the checkout."""
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_holds_every_file_of_the_package_and_the_urdf(wheel: Path):
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("scara_ident/")}
        urdf = archive.read("scara_ident/urdf/scara03.urdf")
    assert names == tree(PACKAGE) | {"scara_ident/urdf/scara03.urdf"}
    assert "scara_ident/py.typed" in names
    assert {"page.py", "report.js", "report.css", "plot.js"} <= {name.rsplit("/", 1)[1] for name in names}
    assert urdf == (ROOT / "urdf" / "scara03.urdf").read_bytes()


def test_the_wheel_says_what_it_needs_and_brings_the_command(wheel: Path):
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        said = archive.read(metadata).decode()
        entry = archive.read(metadata.replace("METADATA", "entry_points.txt")).decode()
    assert "scara-ident = scara_ident.cli:main" in entry
    assert "Requires-Python: >=3.11" in said
    required = {line.split(":")[1].strip() for line in said.splitlines() if line.startswith("Requires-Dist")}
    always = {name for name in required if "extra ==" not in name}
    # A user needs no tools of developers.
    assert not [
        name for name in always if name.startswith(("pytest", "mkdocs", "zensical", "mypy", "ruff", "playwright"))
    ]


# In a package's metadata and in imports some names differ.
MODULE = {"pin": "pinocchio", "pyyaml": "yaml", "example-robot-data": None}
# Declared though only tests import it: what is exported is read by a second reader.
FOR_TESTS = {"yourdfpy"}


def test_what_is_declared_is_what_is_imported():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {re.match(r"[a-z0-9-]+", line)[0] for line in settings["dependencies"]}
    trees = [ast.walk(ast.parse(path.read_text())) for path in PACKAGE.rglob("*.py")]
    nodes = [node for tree in trees for node in tree]
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom)]
    imported = {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) - {"scara_ident"}
    # What a command needs and few have is an extra, imported where it is used.
    extras = {
        re.match(r"[a-z0-9-]+", line)[0]
        for extra, lines in settings["optional-dependencies"].items()
        for line in lines
        if extra not in ("docs", "test")
    }
    assert imported - extras == {MODULE.get(name, name) for name in declared - FOR_TESTS} - {None}


def test_outside_the_checkout_the_wheel_finds_its_arm_and_its_assets(installed: Path, tmp_path: Path):
    code = (
        "import scara_ident, scara_ident.robot.robot as r; from scara_ident.report.html.page import Page, asset; "
        "print(scara_ident.__file__, r.embedded_urdf(), r.load_robot().name, asset('report.js') in Page('', '', (), ()).render())"
    )
    file, urdf, name, assets = outside(installed, tmp_path, "-c", code).split()
    assert Path(file).is_relative_to(installed)
    assert Path(urdf).is_relative_to(installed)
    assert (name, assets) == ("scara03", "True")


def test_outside_the_checkout_the_command_of_the_wheel_runs(installed: Path, tmp_path: Path):
    program = "from scara_ident.cli import main; main()"
    assert "P_d1" in outside(installed, tmp_path, "-c", program, "base", "--output", "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["base.json"]


def test_the_source_archive_holds_the_package_its_arm_and_its_tests(tmp_path: Path):
    builders = pytest.importorskip("hatchling.builders.sdist", reason="needs the extra test: pip install '.[test]'")
    (built,) = builders.SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(built) as archive:
        names = {name.split("/", 1)[1] for name in archive.getnames()}
    assert tree(PACKAGE) <= names
    needed = {"urdf/scara03.urdf", "README.md", "LICENSE", "pyproject.toml", "Makefile", "mkdocs.yml"}
    assert needed <= names
    assert {"docs/tutorial.md", "docs/tutorial.ipynb", "tests/test_package.py"} <= names
