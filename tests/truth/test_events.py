"""A person who pushes an arm: named as that, when, and neither an effect nor in the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.identification.identify import identify
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from tests.arms import ur5
from tests.truth.pushes import pushed
from tests.truth.scenes import formula_run

pytestmark = pytest.mark.slow

ROBOT = ur5()
# 7 to 27 N m on the first joint.
PUSHES = (("run1", 4.0, 5.5, (25.0, 20.0, 0.0)), ("run3", 7.0, 7.8, (-30.0, 25.0, 10.0)))


@cache
def runs(count: int) -> tuple[Recording, ...]:
    return tuple(
        formula_run(ROBOT, f"run{k}", [43, k], seconds=10.0, rate=125.0, bits=20, noise=0.012) for k in range(count)
    )


def with_pushes(recordings: Sequence[Recording]) -> list[Recording]:
    done = {name: (np.array(force), start, stop) for name, start, stop, force in PUSHES}
    return [pushed(ROBOT, run, *done[run.name]) if run.name in done else run for run in recordings]


def test_pushes_are_events_and_no_effect():
    """Commit a6cf3ca called it `complete` or `explained`, with 7 to 27 N m unexplained on the first joint."""
    found = diagnose(ROBOT, with_pushes(runs(4)))
    assert found.effects == ()
    assert [event["recording"] for event in diagnosis_dict(found)["events"]] == ["run1", "run3"]
    for event, (_, start, stop, _) in zip(found.events, PUSHES, strict=True):
        assert event.start == pytest.approx(start, abs=0.1)
        assert event.stop == pytest.approx(stop, abs=0.1)
        assert event.kind == "contact"
    # What is left is the noise: nothing of the pushes.
    left = [rows.rms(found.after.value) for rows in found.training_after.joints]
    plain = identify(ROBOT, runs(4), bands=found.search.bands)
    assert left == pytest.approx([rows.rms(plain.estimate.value) for rows in plain.training.joints], rel=0.1)


def test_a_sixth_recording_with_a_push_moves_parameters_by_less_than_their_std():
    five = runs(6)[:5]
    alone = identify(ROBOT, five)
    sixth = pushed(ROBOT, runs(6)[5], np.array([20.0, -10.0, 15.0]), 6.0, 7.5)
    found = identify(ROBOT, [*five, sixth], bands=alone.bands)
    assert [event.recording for event in found.events] == ["run5"]
    known = ~alone.estimate.undetermined
    shift = np.abs(found.estimate.value - alone.estimate.value)[known] / alone.estimate.std[known]
    # A sixth more of data moves them by 0.4 std rms by itself; of 60 the largest is then about one.
    assert np.sqrt(np.mean(shift**2)) < 0.6
    assert np.mean(shift < 1.0) > 0.95
