"""What an audit works on."""

from __future__ import annotations

import numpy as np

from scara_ident.recording.audit import Samples, audit
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
