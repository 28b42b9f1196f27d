"""Recordings on disk and the program run in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest

from scara_ident.cli import console, progress_bar
from scara_ident.cli.main import run
from scara_ident.progress import Tell
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


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The steps that a terminal would be told of."""
    told: list[str] = []

    @contextmanager
    def shown(terminal) -> Iterator[Tell]:
        yield lambda step, done: told.append(step) if 0.0 <= done <= 1.0 else told.append(f"{step}: {done}")

    monkeypatch.setattr(console, "errors_console", lambda: SimpleNamespace(is_terminal=True))
    monkeypatch.setattr(progress_bar, "shown", shown)
    return told


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
