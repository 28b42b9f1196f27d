"""An effect of all joints is the same as that of a single one only where both are there, and it is taken out of the data."""

from __future__ import annotations

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.selection.of_all_joints import takes_in
from scara_ident.effects import Member
from scara_ident.effects.measurement import TimeDelay
from scara_ident.effects.position import Spring
from scara_ident.effects.recording_delays import DelayOfEachRecording

WHOLE, SINGLE = (Candidate(TimeDelay(), Member(joint)) for joint in (None, 0))


def test_that_of_all_joints_takes_in_that_of_a_single_one_and_never_the_reverse():
    assert takes_in(WHOLE, SINGLE)
    assert takes_in(Candidate(DelayOfEachRecording(), Member(None)), SINGLE)
    assert not takes_in(SINGLE, WHOLE)
    assert not takes_in(SINGLE, SINGLE)
    assert not takes_in(WHOLE, WHOLE)


def test_another_effect_of_a_joint_is_not_taken_in():
    assert not takes_in(WHOLE, Candidate(Spring(), Member(0)))
