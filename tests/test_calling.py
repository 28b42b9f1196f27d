"""Messages name what the caller gives: options of the command, arguments of Python."""

from __future__ import annotations

import ast
import re

import pytest

from scara_ident.calling import asked_for, by_command
from scara_ident.errors import UsageError
from scara_ident.memory import set_limit
from tests.shared import ROOT

OPTION = re.compile(r"(?<![\w-])--[a-z]")
# What reads words of the command, writes of files for it, or names a command with its options: no function of Python gets there.
FOR_THE_COMMAND = {
    "excitation/stopping.py", "excitation/known.py", "asking.py", "recording/wanted.py", "inquiry/next_steps.py",
}  # fmt: skip


def test_an_argument_has_the_options_name_and_value():
    assert asked_for("--robot") == "robot"
    assert asked_for("--method consistent") == "method='consistent'"
    assert asked_for("--validate", "validation") == "validation"


def test_a_command_is_asked_for_options_until_it_ends():
    with pytest.raises(UsageError, match=r"^--max-memory 0:"), by_command(), by_command():
        set_limit(0.0)
    with pytest.raises(UsageError, match=r"^gigabytes 0:"):
        set_limit(0.0)


def test_no_message_of_a_function_names_an_option():
    """Functions of Python asked for --range, --robot and --max-memory."""
    found = []
    for path in sorted((ROOT / "scara_ident").rglob("*.py")):
        name = path.relative_to(ROOT / "scara_ident").as_posix()
        if name.startswith("cli/") or name in FOR_THE_COMMAND:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        called = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _is_asked(node)]
        asked = {id(inner) for node in called for inner in ast.walk(node)}
        docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        found += [
            f"{name}:{node.lineno}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and OPTION.search(node.value)
            if id(node) not in asked | docs
        ]
    assert found == []


def _is_asked(node: ast.Call) -> bool:
    return isinstance(node.func, ast.Name) and node.func.id == "asked_for"
