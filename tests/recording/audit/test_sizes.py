"""Numbers that are no measurement."""

from __future__ import annotations

import numpy as np
import pytest

from tests.made_recordings import columns
from tests.recording.audit.made import Read, only, refusal


@pytest.mark.parametrize("rows", [slice(None, None, 2), slice(600, None)], ids=["every other", "half a file"])
@pytest.mark.parametrize("signal", ["position", "effort"])
def test_numbers_that_no_channel_gives_are_refused(read: Read, signal: str, rows: slice):
    made = columns(1200)
    made[f"joint2.{signal}"][rows] = -1e29
    said = refusal(read, made)
    assert f"joint2.{signal} is -1e+29 in row {(rows.start or 0) + 1} " in said
    assert (
        f"in {np.count_nonzero(made[f'joint2.{signal}'] == -1e29)} of 1200 rows; check the type of its numbers" in said
    )


@pytest.mark.parametrize("signal", ["position", "effort"])
def test_a_single_one_is_left_out(read: Read, signal: str):
    made = columns(1200)
    made[f"joint2.{signal}"][700] = 1e29
    recording = read(made)
    assert "row 701" in only(recording, "spike").message
    assert len(recording.time) == 1199
