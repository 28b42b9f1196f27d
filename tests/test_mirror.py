"""Every module has its test file, in the place and under the name that tell which module it is for."""

from __future__ import annotations

from pathlib import Path

from tests.shared import ROOT

# Modules without a file of their own, and where what they do is tested.
ELSEWHERE = {
    "errors.py": "declarations of exceptions alone; test_main.py has what each becomes for a user",
    "cli/options.py": "declarations of options alone; the test of each command uses them",
}
LARGEST = 400


def wanted(package: Path) -> dict[str, str]:
    """Return the test file of every module, both relative; a package's own file is tested through its modules."""
    found = {}
    for path in sorted(package.rglob("*.py")):
        if path.name != "__init__.py":
            module = path.relative_to(package)
            found[module.as_posix()] = module.with_name(f"test_{module.name}").as_posix()
    return found


def test_every_module_has_its_test_file():
    files = wanted(ROOT / "scara_ident")
    assert len(files) > 150
    missing = {module for module, file in files.items() if not (ROOT / "tests" / file).is_file()}
    assert missing - set(ELSEWHERE) == set()
    assert set(ELSEWHERE) <= missing


def test_no_test_file_is_long():
    files = (ROOT / "tests").rglob("*.py")
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {name: count for name, count in lines.items() if count > LARGEST} == {}
