"""The examples of every public name run, in an empty folder."""

from __future__ import annotations

import doctest
import importlib
import inspect
from pathlib import Path

import pytest

import scara_ident

# The main jobs, which have an example each.
SHOWN = {
    "build_model", "compare", "consistent", "design_excitation", "diagnose", "export_urdf",
    "find_base_parameters", "identify", "load_estimate", "load_robot", "read_recordings", "simulate",
}  # fmt: skip
# Some stand beside functions that are no public names themselves.
MODULES = sorted({f"scara_ident.{module}" for module in scara_ident._HOMES.values()} | {"scara_ident.registry"})


def test_every_main_job_has_an_example():
    assert [name for name in sorted(SHOWN) if ">>> " not in (inspect.getdoc(getattr(scara_ident, name)) or "")] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", MODULES)
def test_the_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    failed, _ = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0
