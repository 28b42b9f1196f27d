"""Recordings on disk and the program run in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from scara_ident.cli.main import run
from scara_ident.recording.recording import write_recording
from tests.report.simulated import run as simulate


class Outcome(NamedTuple):
    """What a command gave back."""

    status: int
    out: str
    err: str


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    def call(*words: str | Path) -> Outcome:
        capfd.readouterr()
        status = run([str(word) for word in words])
        captured = capfd.readouterr()
        assert "Traceback" not in captured.err
        assert "\x1b" not in captured.out + captured.err
        if status:
            assert captured.err.startswith("scara-ident: ")
            assert captured.err.count("\n") == 1
        else:
            assert captured.err == ""
        return Outcome(status, captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs: two of OJD as Parquet, one of another stretch of it as CSV."""
    place = tmp_path_factory.mktemp("runs")
    for item, suffix in (
        (simulate("OJD_1", 1), "parquet"),
        (simulate("OJD_2", 2), "parquet"),
        (simulate("CI_1", 3, start=4.0), "csv"),
    ):
        write_recording(item, place / f"{item.name}.{suffix}")
    return place
