"""A recording as columns: every signal that is there, efforts as they were recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.recording.columns import recording_columns
from tests.results import Results


@pytest.mark.slow
def test_signals_that_are_there_are_columns(results: Results):
    run = results.runs[0].recording
    columns = recording_columns(run)
    assert list(columns) == ["time", *(f"joint{j}.{kind}" for kind in ("position", "effort") for j in (1, 2))]
    assert columns["joint2.effort"].tolist() == run.effort[1].tolist()
    gain = recording_columns(run, np.array([2.0, 4.0]))
    assert gain["joint2.effort"].tolist() == (run.effort[1] / 4.0).tolist()
    second = replace(run, link_position=np.stack([run.position[0], np.full_like(run.time, np.nan)]))
    assert [name for name in recording_columns(second) if "link" in name] == ["joint1.link_position"]
