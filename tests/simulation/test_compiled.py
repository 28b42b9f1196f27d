"""Compiled functions, and the machine code kept of them."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path

import pytest

from scara_ident.simulation import compiled as module
from scara_ident.simulation import integrate
from scara_ident.simulation.compiled import SOURCES, at_hand, compiled

ROOM = Path(module.__file__).parent


def test_a_compiled_function_gives_what_the_function_gives():
    def norm(x: float, y: float) -> float:
        total = 0.0
        for part in (x, y):
            total += part * part
        return math.sqrt(total)

    found = compiled(norm)
    assert [found(3.0, 4.0), found(-1.0, 0.0)] == [norm(3.0, 4.0), norm(-1.0, 0.0)]


def test_every_module_with_compiled_functions_counts_among_the_sources():
    """Else machine code of an older source would be run after a change of it."""
    using = {
        path.name
        for path in ROOM.glob("*.py")
        if re.search(r"^@compiled(_within|_in_place)?$", path.read_text(), re.MULTILINE)
    }
    assert using
    assert using <= set(SOURCES)
    # What they read of the package at compile time counts as well.
    for name in using:
        text = (ROOM / name).read_text(encoding="utf-8")
        inner = re.findall(r"^from scara_ident\.simulation\.(\w+) import", text, re.MULTILINE)
        assert {f"{each}.py" for each in inner} <= set(SOURCES), name


@pytest.mark.parametrize("name", ["step", "first_stage", "_runge_kutta", "_first_to_stop"])
def test_the_loop_hands_a_plant_to_none_of_its_steps(name: str):
    """To call them takes as long as what they do, and the whole loop twice as long."""
    assert getattr(integrate, name).targetoptions["forceinline"]


@pytest.mark.parametrize("changed", SOURCES)
def test_a_change_of_any_source_changes_the_stamp(changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name in SOURCES:
        (tmp_path / name).write_bytes((ROOM / name).read_bytes())
    monkeypatch.setattr(module, "__file__", str(tmp_path / "compiled.py"))
    before = module._stamp.__wrapped__()
    assert module._stamp.__wrapped__() == before
    with (tmp_path / changed).open("a") as file:
        file.write("\n")
    assert module._stamp.__wrapped__() != before


def test_whether_a_function_runs_at_once_is_known_before_it_is_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "small_loop.py").write_text("def twice(x: float) -> float:\n    return 2.0 * x\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    twice = importlib.import_module("small_loop").twice
    found = compiled(twice)
    assert not at_hand(found)
    assert found(2.0) == 4.0
    assert at_hand(found)
    # In another process it would be read from disk.
    assert at_hand(compiled(twice))
