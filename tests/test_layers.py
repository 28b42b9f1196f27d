"""The rooms of the package: imports go down one list of them, and no module is a house of its own."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import median

import pytest

from tests.shared import ROOT

PACKAGE = ROOT / "scara_ident"
# A room imports from those before it, within functions too. Three places are chosen for what needs what:
# `paper` is closed forms and printed tables alone, and excitation and simulation repeat its motions; `inspection`
# weighs efforts by the URDF's masses, so it comes after the model; `export` writes what `identification` found.
ROOMS = (
    "errors", "calling", "arrays", "threads", "processes", "progress", "registry", "files", "memory", "quiet",
    "manners",
    "robot", "paper", "recording", "motion", "model", "estimation", "inspection", "identification",
    "effects", "diagnosis", "inquiry", "online", "excitation", "export", "simulation", "fleet", "use", "report", "asking", "cli",
    "__main__",
)  # fmt: skip
# Rooms within a room, in the same way.
WITHIN = {
    "diagnosis": (
        "criteria", "work", "candidates", "testing", "fitting", "checks", "selection", "evidence", "held_out",
        "whole_estimate", "proxies", "model_selection", "found_effect", "braking_evidence", "possible_evidence", "verdict", "diagnose",
    ),
}  # fmt: skip
LARGEST, MEDIAN = 400, 145
# Modules that lie side by side in a room: of more nobody sees at a glance which one to open.
MOST = 45


def modules(package: Path) -> dict[str, Path]:
    """Every module by its dotted name within the package; the package itself is left out."""
    found = {}
    for path in package.rglob("*.py"):
        parts = path.relative_to(package).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name:
            found[name] = path
    return found


def imports(tree: ast.AST) -> Iterator[str]:
    """Names within the package that a module imports, in functions too, but not for the type checker alone."""
    for node in ast.iter_child_nodes(tree):
        # No expression holds one.
        if isinstance(node, ast.expr) or (isinstance(node, ast.If) and _for_types(node.test)):
            continue
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are written in full"
            if node.module and node.module.split(".")[0] == "scara_ident":
                inner = node.module.removeprefix("scara_ident").lstrip(".")
                yield from (f"{inner}.{alias.name}".lstrip(".") for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (
                alias.name.removeprefix("scara_ident.") for alias in node.names if alias.name.startswith("scara_ident.")
            )
        yield from imports(node)


def _for_types(test: ast.expr) -> bool:
    return any(isinstance(node, ast.Name) and node.id == "TYPE_CHECKING" for node in ast.walk(test))


def graph(package: Path) -> dict[str, set[str]]:
    """What each module imports: the module of the name, or the name itself where that is a module."""
    files = modules(package)
    found = {}
    for name, path in files.items():
        wanted = imports(ast.parse(path.read_text(encoding="utf-8")))
        targets = {each if each in files else each.rpartition(".")[0] for each in wanted}
        found[name] = {target for target in targets if target in files and target != name}
    return found


def upward(found: dict[str, set[str]], rooms: Sequence[str] = ROOMS) -> list[str]:
    """Imports that go up the list of rooms."""
    place = {room: k for k, room in enumerate(rooms)}
    return sorted(
        f"{name} imports {target}"
        for name, targets in found.items()
        for target in targets
        if place[target.split(".")[0]] > place[name.split(".")[0]]
    )


def within(found: dict[str, set[str]], room: str) -> dict[str, set[str]]:
    """What the modules of a room import of the same room, by their names in it."""
    inside = {name.removeprefix(f"{room}."): targets for name, targets in found.items() if name.startswith(f"{room}.")}
    return {
        name: {target.removeprefix(f"{room}.") for target in targets if target.startswith(f"{room}.")}
        for name, targets in inside.items()
    }


@pytest.mark.slow
def test_every_room_is_in_the_list():
    assert {name.split(".")[0] for name in modules(PACKAGE)} == set(ROOMS)
    for room, order in WITHIN.items():
        assert {name.split(".")[0] for name in within(graph(PACKAGE), room)} == set(order)


@pytest.mark.slow
def test_no_import_goes_up_or_round():
    found = graph(PACKAGE)
    assert sum(map(len, found.values())) > 300
    assert upward(found) == []
    TopologicalSorter(found).prepare()
    for room, order in WITHIN.items():
        inside = within(found, room)
        assert sum(map(len, inside.values())) > 100
        assert upward(inside, order) == []


def test_no_room_is_a_heap():
    sizes = Counter(path.parent.relative_to(PACKAGE).as_posix() for path in modules(PACKAGE).values())
    assert {room: size for room, size in sizes.items() if size > MOST} == {}


def test_the_test_sees_imports_in_functions_and_cycles(tmp_path: Path):
    for room in ("robot", "model"):
        (tmp_path / room).mkdir()
    (tmp_path / "model" / "up.py").write_text("from scara_ident.robot import down\n")
    (tmp_path / "robot" / "down.py").write_text("def late():\n    import scara_ident.model.up\n")
    found = graph(tmp_path)
    assert upward(found) == ["robot.down imports model.up"]
    assert within({"a.b.c": {"a.d.e", "f"}, "f": {"a.d.e"}}, "a") == {"b.c": {"d.e"}}
    assert upward({"b.c": {"d.e"}}, ("b", "d")) == ["b.c imports d.e"]
    with pytest.raises(CycleError):
        TopologicalSorter(found).prepare()
    (tmp_path / "robot" / "down.py").write_text("if TYPE_CHECKING:\n    from scara_ident.model import up\n")
    assert upward(graph(tmp_path)) == []


def test_modules_are_small():
    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in modules(PACKAGE).items()}
    assert {name: count for name, count in lines.items() if count > LARGEST} == {}
    assert median(lines.values()) <= MEDIAN
