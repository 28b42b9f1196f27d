"""What an audit works on."""

from __future__ import annotations

import numpy as np

from scara_ident.recording.audit import Samples, audit
from scara_ident.recording.audit.samples import levels, resolution
from tests.made_recordings import columns


def test_the_audit_leaves_the_samples_it_was_given_alone(robot):
    made = columns()
    made["joint1.position"][1234] += 1.0
    position = np.array([made["joint1.position"], made["joint2.position"]])
    effort = np.array([made["joint1.effort"], made["joint2.effort"]])
    before = [made["time"].copy(), position.copy(), effort.copy()]
    audit(Samples("run", robot, made["time"], position, effort, np.arange(1, 4001)))
    for array, copy in zip((made["time"], position, effort), before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_a_sample_is_named_by_the_time_in_the_file_unless_that_counts_from_an_epoch(robot):
    """Row 653 of a log was at "1.74943e+09 s"."""
    time = 1e-3 * np.arange(2000)
    nothing, rows = np.zeros((2, 2000)), np.arange(1, 2001)
    assert Samples("run", robot, 40.0 + time, nothing, None, rows).where(652) == "row 653 (40.652 s)"
    epoch = Samples("run", robot, 1749430812.25 + time, nothing, None, rows)
    assert epoch.where(652) == "row 653 (0.652 s after the first)"


def test_levels_and_steps_of_a_rounded_signal_are_those_before_rounding():
    signal = np.array([0.3, 0.1 + 0.2, 0.1, 0.3, 0.7, 0.1])
    np.testing.assert_array_equal(levels(signal), [0.1, 0.3, 0.7])
    assert resolution(signal) == 0.3 - 0.1
    assert resolution(np.full(5, 0.2)) == 0.0
    np.testing.assert_array_equal(levels(np.full(5, 0.2)), [0.2])
