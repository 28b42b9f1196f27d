"""Benchmarks, which no other test runs, take only names that the package has."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec

from tests.shared import ROOT

FILES = sorted((ROOT / "benchmarks").rglob("*.py"))


def test_what_benchmarks_import_from_the_package_is_there():
    assert FILES
    missing = [
        f"{path.name}: {node.module}.{name.name}"
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "scara_ident"
        for name in node.names
        if not _there(node.module or "", name.name)
    ]
    assert missing == []


def _there(module: str, name: str) -> bool:
    found = import_module(module)
    return hasattr(found, name) or (hasattr(found, "__path__") and find_spec(f"{module}.{name}") is not None)
