"""A torque that runs on its own repeats in no recording, and is no noise all the same."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.evidence.standing_lines import StandingLine, standing_lines, tentative_lines, without_lines
from scara_ident.effects.periodic import Vibration
from scara_ident.effects.position import Spring
from scara_ident.estimation import wls
from scara_ident.estimation.residuals import Residuals
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, observed, virtual_runs

# Of two motions, twice each, with next to nothing that repeats.
PHASES = (0.3, 3.2, 1.9, 4.7)


def with_tone(run: Recording, frequency: float, amplitude: float, phase: float) -> Recording:
    assert run.effort is not None
    tone = amplitude * np.sin(2.0 * np.pi * frequency * run.time + phase)
    return replace(run, effort=run.effort + np.array([np.zeros_like(tone), tone]))


@lru_cache
def plain() -> tuple[Recording, ...]:
    """Nothing is missing."""
    return tuple(virtual_runs())


def left_of(recordings: list[Recording]) -> Residuals:
    seen = observed(recordings, BANDS)
    return seen.residuals(wls(seen).value)


@lru_cache
def diagnosed(frequency: float, amplitude: float) -> Diagnosis:
    toned = [with_tone(run, frequency, amplitude, phase) for run, phase in zip(plain(), PHASES, strict=True)]
    return diagnose(load_robot(), toned, bands=BANDS, catalogue=(Vibration(), Spring()))


def test_nothing_is_said_of_noise():
    found = diagnosed(7.3, 0.0)
    assert found.verdict == "complete"
    assert found.tentative == ()


def test_a_line_of_any_phase_is_no_noise_and_named():
    """`complete` was said beside 0.05 N m at 3 Hz: it repeats in no recording, so that it counted as noise."""
    found = diagnosed(7.3, 0.05)
    assert found.verdict == "undecided"
    first, second = found.evidence
    assert first.shown
    assert not second.shown
    assert re.search(
        r"a spectral line of 0\.0(49|5)\d* N m at 7\.30\d Hz, which is not noise, and has another phase", second.why
    )
    (tentative,) = found.tentative
    assert (tentative.effect, tentative.joint, tentative.settled_by) == ("vibration", "joint2", Vibration.experiment)
    assert tentative.gain > 0.5
    assert tentative.p_value < 1e-6
    (entry,) = diagnosis_dict(found)["tentative"]
    assert re.fullmatch(r"a vibration of 7\.30\d? Hz", entry["description"])


def test_a_line_above_the_band_asks_for_a_wider_one():
    """0.2 N m at 40 Hz repeated exactly, above a band of 17 Hz."""
    found = diagnosed(40.0, 0.2)
    assert found.verdict == "undecided"
    assert found.evidence[1].why.startswith("above the band of ")
    assert found.evidence[1].why.endswith("give a wider band")
    assert "at 40 Hz" in found.evidence[1].why


def test_a_line_of_the_positions_alone_is_none_above_the_band():
    """Of a cart on a rail what its encoder rounded away, the same in every repetition, was a line of 0.07 N at 53 Hz."""
    recordings = []
    for run in plain():
        wavering = 1e-5 * np.sin(2.0 * np.pi * 30.0 * run.time)
        recordings.append(replace(run, position=run.position + np.array([np.zeros_like(wavering), wavering])))
    assert standing_lines(left_of(recordings)) == (None, None)
    # With as much in the torque it is one of the torque.
    _, line = standing_lines(left_of([with_tone(run, 30.0, 0.2, 0.4) for run in recordings]))
    assert line is not None
    assert line.frequency == pytest.approx(30.0, abs=0.02)


@pytest.mark.parametrize(("size", "there"), [(0.1, False), (0.4, False), (1.0, True)])
def test_within_the_band_a_line_counts_by_its_share(size: float, there: bool):
    """By the amplitude over that of all noise within the band: of 1.0 a third of the power is the line."""
    residuals = left_of(list(plain()))
    parts = zip(residuals.data.stretches, residuals.banded, strict=True)
    noise = np.sqrt(np.mean(np.concatenate([own[1][part.trim : -part.trim] for part, own in parts]) ** 2))
    toned = [with_tone(run, 7.3, size * noise, 0.4 * k) for k, run in enumerate(plain())]
    first, second = standing_lines(left_of(toned))
    assert first is None
    assert (second is not None) == there
    if second is not None:
        assert second.joint == 1
        assert second.within
        assert second.frequency == pytest.approx(7.3, abs=0.02)
        assert second.amplitude == pytest.approx(noise * size, rel=0.1)
        assert second.share == pytest.approx(0.5 * size**2 / (1.0 + 0.5 * size**2), rel=0.15)


def test_recordings_of_another_rate_do_not_move_a_line():
    """Their samples, taken for those of the first rate, would have the line at another frequency."""
    slow = [run for run in plain() if run.name.startswith("F2")]
    halved = [
        replace(run, time=run.time[::2], position=run.position[:, ::2], effort=run.effort[:, ::2])
        for run in (with_tone(run, 7.3, 0.05, 0.4) for run in slow)
        if run.effort is not None
    ]
    whole = [with_tone(run, 7.3, 0.05, 0.4) for run in plain() if run.name.startswith("F1")]
    _, line = standing_lines(left_of([*whole, *halved]))
    assert line is not None
    assert line.frequency == pytest.approx(7.3, abs=0.02)


def test_what_is_known_is_not_listed_again():
    found = diagnosed(7.3, 0.05)
    lines = (None, StandingLine(1, 7.3, 0.05, 0.9, True, 1e-20))
    families = (Vibration(),)
    assert len(tentative_lines(lines, found.search, families, ())) == 1
    assert tentative_lines(lines, found.search, families, {("vibration", "joint2")}) == ()
    assert tentative_lines(lines, found.search, (), ()) == ()
    shown = tuple(Evidence(joint, joint == "joint1", "", "as it was", 0.1) for joint in ("joint1", "joint2"))
    assert without_lines(shown, lines, found.search) == shown


def test_at_one_amplitude_the_sentence_says_what_and_what_to_do():
    say: Callable[..., str] = StandingLine(0, 40.0, 0.2, 900.0, False, 0.0).sentence
    assert say("N m", 17.1) == (
        "above the band of 17.1 Hz there is a spectral line of 0.2 N m at 40 Hz, which is not noise, and is larger than all that is left "
        "within the band: give a wider band"
    )
