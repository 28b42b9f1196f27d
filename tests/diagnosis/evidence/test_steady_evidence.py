"""An arm that changes within its recordings, another way in each, leaves what repeats in none and is no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.steady_evidence import MIN_BLOCKS, _parted, steady_evidence
from scara_ident.estimation import wls
from scara_ident.recording.recording import Recording
from tests.diagnosis.made import exact_runs, observed, with_torque

SHOWN = tuple(Evidence(joint, True, "repetition", "", 0.1) for joint in ("joint1", "joint2"))


def told(runs: Sequence[Recording]) -> tuple[Evidence, ...]:
    training = observed(runs)
    return steady_evidence(SHOWN, wls(training), training)


def changing(size: float, period: float, joint: int = 1, kind: str = "friction") -> list[Recording]:
    """Dry friction, or a torque, that swings over a period, beginning anew in each recording."""
    random = np.random.default_rng(6)
    made = []
    for run in exact_runs(2, 3):
        phase = random.uniform(0.0, 2.0 * np.pi)

        def swing(motion, phase=phase):
            course = size * np.sin(2.0 * np.pi * motion.time / period + phase)
            return course * np.sign(motion.v[joint]) if kind == "friction" else course

        made += with_torque([run], joint, swing)
    return made


def test_runs_of_a_steady_arm_pass():
    assert told(exact_runs(2, 3)) == SHOWN


@pytest.mark.parametrize(("kind", "period"), [("friction", 9.0), ("friction", 2.0), ("offset", 9.0)])
def test_what_changes_within_recordings_is_no_noise(kind: str, period: float):
    """`complete` was said of friction that changed by 40 % over 25 s: "at most 0 repeats, and 0.0144 that does not"."""
    first, second = told(changing(0.05, period, kind=kind))
    assert first.shown
    assert not second.shown
    assert "varies within recordings as if its " in second.why
    # Within seconds a joint goes one way, and its friction is an offset.
    assert period < 9.0 or f"its {kind} changed during each recording (standard deviation 0." in second.why
    assert second.why.endswith("differently in each")


def test_a_little_of_it_is_let_pass():
    """A quarter of the power may be what it likes."""
    assert told(changing(0.001, 9.0)) == SHOWN


def test_what_runs_differ_by_is_none_of_it():
    random = np.random.default_rng(2)
    differing = [
        with_torque([run], 1, lambda motion, size=size: size * np.sign(motion.v[1]))[0]
        for run, size in zip(exact_runs(2, 3), random.uniform(-0.03, 0.03, 6), strict=True)
    ]
    training = observed(differing)
    after = wls(training)
    assert after.variation
    assert steady_evidence(SHOWN, after, training) == SHOWN


def test_nothing_is_asked_where_nothing_was_shown_or_parts_are_too_short():
    training = observed(changing(0.05, 9.0))
    doubted = tuple(replace(item, shown=False) for item in SHOWN)
    assert steady_evidence(doubted, wls(training), training) == doubted
    few = replace(training, owner=np.arange(len(training.owner)) // (2 * MIN_BLOCKS - 1))
    assert steady_evidence(SHOWN, wls(training), few) == SHOWN


def test_a_short_recording_keeps_none_of_the_others_from_being_parted():
    owner = np.repeat([0, 1, 2], [40, 5, 9])
    parted = _parted(owner, 4)
    assert parted is not None
    assert parted.tolist() == [0, 10, 20, 30, 40, 45, 49, 54]
    assert _parted(np.repeat([0, 1], [7, 7]), 4) is None
