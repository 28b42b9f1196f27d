"""Noise of positions that stands in the residual and in a candidate's column, and what it makes of the candidate."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks import noise_check
from scara_ident.diagnosis.checks.noise_check import (
    made_through_the_controller,
    noise_objection,
    noise_of_column,
    without_noise,
)
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.candidate_tests import Examination, examine
from scara_ident.diagnosis.testing.cluster_test import significance
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.effects import Member
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from scara_ident.effects.presliding import Presliding
from scara_ident.effects.smooth_coulomb import SmoothCoulomb
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.recording.recording import Recording
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.diagnosis.made import NOISE, RATE, exact_runs, multisine, step_beside

BLOCKS, ROWS = 100, 12
LENGTH = BLOCKS * ROWS


def examined(base: np.ndarray, tried: np.ndarray, torque: np.ndarray) -> Examination:
    starts = np.arange(0, LENGTH + 1, ROWS)
    rows = JointRows(np.arange(2), np.vstack([base, np.ones(LENGTH), torque]), starts, np.full(BLOCKS, float(ROWS)))
    model = FittedModel((rows,), 2, np.zeros(BLOCKS, dtype=int), np.arange(BLOCKS) * 4 // BLOCKS, np.ones(1))
    return examine(model, [{0: tried[None]}])[0]


def with_noise_once_and_twice(true: float, torque_noise: float) -> tuple[Examination, Examination]:
    """A candidate of that size; the base column holds noise, the candidate's the same magnified, as derivatives of a position do."""
    rng = np.random.default_rng(4)
    smooth, other = lfilter([1.0], [1.0, -0.9], rng.standard_normal((2, LENGTH)), axis=1)
    torque = 2.0 * smooth + true * other + torque_noise * rng.standard_normal(LENGTH)
    noise, again = 0.3 * rng.standard_normal((2, LENGTH))
    once = examined(smooth + noise, other + 3.0 * noise, torque)
    twice = examined(smooth + noise + again, other + 3.0 * (noise + again), torque)
    return once, twice


@pytest.mark.parametrize("true", [0.0, 0.4])
def test_what_the_noise_makes_is_taken_off_and_what_the_arm_does_is_left(true: float):
    once, twice = with_noise_once_and_twice(true, 0.1)
    assert abs(once.value[0] - true) > 0.05
    assert once.p_value < 1e-12
    left = without_noise(once, twice.value, twice.products)
    assert abs(left[0]) == pytest.approx(true, abs=0.07)
    p_value = significance(left, once.covariance, once.freedom, once.products)
    assert (p_value < 1e-6) if true else (p_value > 1e-3)


@pytest.mark.parametrize(("true", "believed"), [(0.4, True), (-0.12, False)])
def test_what_is_mostly_noise_is_not_believed_however_sure_the_rest_is(
    true: float, believed: bool, monkeypatch: pytest.MonkeyPatch
):
    """An elastic elbow stood for a wrist's: a tenth of it was left without the noise, with p = 1e-20."""
    once, twice = with_noise_once_and_twice(true, 0.02)
    noisier = SimpleNamespace(rows=lambda scene, candidates: [None], scene=None, model=None)
    columns = SimpleNamespace(unresolved_for=lambda joint: None)
    step = SimpleNamespace(columns=columns, noisier=noisier, criteria=CRITERIA, tried=100)
    monkeypatch.setattr(noise_check, "coefficients", lambda *_: (twice.value, twice.products))
    candidate = Candidate(Spring(), Member(0))
    decision = Decision(candidate, "spring", once, accepted=True, why="", gain=0.9)
    left = without_noise(once, twice.value, twice.products)
    assert significance(left, once.covariance, once.freedom, once.products) < 1e-6
    said = noise_objection(step, decision)
    assert (said is None) == believed
    assert believed or "the noise of the positions causes it" in said


@pytest.mark.parametrize(
    ("gain", "p_value", "said"),
    [
        (
            0.05001,
            1e-9,
            r"above the detection limit: without that noise 99\.\d% of it is left, which removes 4\.9\d% of the",
        ),
        (
            0.9,
            1.99e-5,
            r"more significant than it is: .* 99\.\d% of it is left, p = 2\.\de-05 instead of 2\.0e-05; with 100 .* 2\.0e-05",
        ),
        (0.9, 1e-9, None),
        # What was let in below the limit need not be above it.
        (0.016, 1e-9, None),
    ],
)
def test_what_only_just_passes_is_not_believed_for_what_it_fails_by(
    gain: float, p_value: float, said: str | None, monkeypatch: pytest.MonkeyPatch
):
    """Of 99.9 % that was left with p = 5.4e-06 it was said that it may be chance."""
    once, _ = with_noise_once_and_twice(0.4, 2.0)
    once = replace(once, p_value=p_value)
    noisier = SimpleNamespace(rows=lambda scene, candidates: [None], scene=None, model=None)
    step = SimpleNamespace(noisier=noisier, criteria=CRITERIA, tried=100)
    left = 0.998 * once.value
    monkeypatch.setattr(noise_check, "without_noise", lambda *_: left)
    monkeypatch.setattr(noise_check, "coefficients", lambda *_: (None, None))
    decision = Decision(Candidate(Spring(), Member(0)), "spring", once, accepted=True, why="", gain=gain)
    objection = noise_check.made_by_noise(step, decision)
    assert objection is None if said is None else re.search(said, objection or "")


def test_what_noise_takes_nothing_from_is_as_sure_as_before():
    """A shaft of which all was left was no more believed: the freedom of its best direction was not in what was asked again."""
    _, found = with_noise_once_and_twice(0.4, 0.02)
    found = replace(found, p_value=1e-3 * significance(found.tested, found.covariance, found.freedom, found.products))
    assert noise_check._left_of(found, found.value).p_value == pytest.approx(found.p_value)
    less = noise_check._left_of(found, 0.5 * found.value)
    assert found.p_value < less.p_value <= 1.0


@pytest.mark.parametrize(("steps", "hidden"), [(0.4, True), (5.0, False)])
def test_what_turns_within_a_step_of_the_encoder_is_not_believed(steps: float, hidden: bool):
    """Presliding over 0.4 steps mended the sign of friction that the steps spoil, and was believed (UR5, 12 and 15 bits)."""
    encoder = 2.0 * np.pi / 2**13
    runs = [replace(run, position=encoder * np.round(run.position / encoder)) for run in exact_runs()]
    step = step_beside(runs)
    (decision,) = step.judge([Candidate(Presliding(), Member(1, (steps * encoder,)))])
    said = noise_objection(step, decision)
    assert ("less than a step of the encoder, 0.00077 rad" in (said or "")) == hidden
    (other,) = step.judge([Candidate(Spring(), Member(1))])
    assert "step" not in (noise_objection(step, other) or "")


@pytest.mark.parametrize(("share", "hidden"), [(4.0, True), (20.0, False)])
def test_friction_that_is_another_one_where_steps_come_one_by_one_is_not_believed(share: float, hidden: bool) -> None:
    """Behind 12 bits a controller's answer to each step made friction that jumps grow with speed."""
    encoder = 2.0 * np.pi / 2**13
    runs = [replace(run, position=encoder * np.round(run.position / encoder)) for run in exact_runs()]
    step = step_beside(runs)
    (part,) = step.observations.data.recordings[0].stretches
    stepping = encoder * part.motion.cuts[1]
    (decision,) = step.judge([Candidate(SmoothCoulomb(), Member(1, (share * stepping,)))])
    said = noise_objection(step, decision)
    assert (f"below {stepping:.2g} rad/s the steps come one by one" in (said or "")) == hidden


def test_friction_that_is_another_one_where_a_joint_passes_within_a_sample_is_not_believed() -> None:
    """Delays that differ by run, corrected to half a millisecond, made friction that jumps grow over 0.01 rad/s, at 250 Hz."""
    step = step_beside(exact_runs())
    changes = np.concatenate(
        [noise_check._changes_at_turns(part.motion.v[1]) for part in step.observations.data.stretches]
    )
    passed = float(np.sqrt(np.mean(changes**2)))
    assert len(changes) and passed > 0.0
    for share, hidden in ((0.8, True), (1.3, False)):
        (decision,) = step.judge([Candidate(SmoothCoulomb(), Member(1, (share * passed,)))])
        assert ("passes that speed within one sample" in (noise_objection(step, decision) or "")) == hidden


def answering(runs: list[Recording], gains: dict[int, float], size: float) -> list[Recording]:
    """The runs with noise in the positions of joints, and a controller's answer to it in these joints' torque."""
    rng, made = np.random.default_rng(5), []
    for run in runs:
        position, effort = run.position.copy(), run.effort.copy()
        for joint, gain in gains.items():
            noise = size * rng.standard_normal(len(run.time))
            position[joint] += noise
            effort[joint] -= gain * np.gradient(noise, run.time)
        made.append(replace(run, position=position, effort=effort))
    return made


@pytest.mark.parametrize(
    ("recorded", "joint", "there"),
    [
        pytest.param(lambda: [shifted(run, -0.008, [1]) for run in exact_runs()], 1, True, id="late"),
        pytest.param(lambda: answering(list(exact_runs()), {1: 2.0}, 3e-4), 1, False, id="answered"),
        pytest.param(lambda: [shifted(run, -0.008) for run in exact_runs()], None, True, id="all late"),
        pytest.param(lambda: answering(list(exact_runs()), {0: 60.0, 1: 2.0}, 3e-4), None, False, id="all answered"),
    ],
)
def test_a_delay_is_about_the_same_in_the_lower_part_of_the_band(recorded, joint: int | None, there: bool):
    """What a controller answered coarse encoders with was two wrists' torque 6 and 10 ms before their motion (UR5).

    On another UR5 it was all joints' torque 14 ms before; below 2.4 Hz it was 0.2 ms after, as sure to 0.9.
    """
    step = step_beside(recorded())
    (decision,) = step.judge([Candidate(TimeDelay(), Member(joint))])
    assert decision.accepted
    said = noise_objection(step, decision)
    assert (said is None) == there
    assert there or ("Hz" in said and "a real one would have the same" in said)


def test_a_delay_behind_noisy_positions_is_what_it_is_once_nothing_is_left_of_it():
    """Of 4 ms that all efforts were late by a UR5 of 18 bits seemed to have 2.1, but 3.6 further down, and had none."""
    step = step_beside(answering([shifted(run, -0.008) for run in exact_runs()], {0: 0.0, 1: 0.0}, 7e-5))
    (decision,) = step.judge([Candidate(TimeDelay(), Member(None))])
    assert decision.accepted
    hidden = noise_of_column(step, decision)
    # What of the column is noise says how much too small the first estimate is: here by half.
    assert decision.examination.value[0] == pytest.approx((1.0 - hidden) * 0.008, rel=0.25)
    assert hidden == pytest.approx(0.5, abs=0.1)
    assert noise_objection(step, decision) is None
    found, _ = noise_check._examined_below(step, decision.candidate, CRITERIA.lower_band)
    assert found.value[0] == pytest.approx(0.008, abs=2.0 * np.sqrt(found.covariance[0, 0]))


def turning_early(run: Recording, seconds: float) -> Recording:
    """The run with friction of both joints that jumps so much before the velocity turns, as a narrow filter makes it seem."""
    speed = np.gradient(run.position, run.time, axis=1)
    early = np.sign([np.interp(run.time + seconds, run.time, own) for own in speed]) - np.sign(speed)
    return replace(run, effort=run.effort + np.array([[0.21], [0.088]]) * early)


@pytest.mark.parametrize("late", [0.0, 0.008])
def test_when_friction_turns_tells_no_delay_in_the_lower_part_of_the_band(late: float, monkeypatch: pytest.MonkeyPatch):
    """In a band of 7 Hz friction of a UR5 turned 1.7 ms early, and torque that was 1 ms early all over seemed 1.9 early there."""
    step = step_beside([shifted(turning_early(run, 0.005), -late) for run in exact_runs()])
    delay = Candidate(TimeDelay(), Member(None))

    def told() -> Examination:
        found = noise_check._examined_below(step, delay, CRITERIA.lower_band)
        assert found is not None
        return found[0]

    assert told().value[0] == pytest.approx(late, abs=1e-3)
    monkeypatch.setattr(TimeDelay, "distinguished_from", lambda *_: ())
    assert told().value[0] < late - 3e-3


def on_coarse_encoders(*effects: str) -> list[Recording]:
    """Runs of an arm whose controller, four times as fast as its log, differentiates encoders of 16 bits per turn."""
    arm = virtual_arm()
    steps = np.round(arm.encoder_steps * arm.encoder_resolution * 2**16 / (2.0 * np.pi))
    arm = replace(arm, encoder_steps=steps, torque_noise=np.array(NOISE))
    added, motions = [parse_effect(text) for text in effects], (multisine("C1", 1, 9.0), multisine("C2", 2, 10.0))
    return [
        simulate(arm, motion, effects=added, seed=3, rate=RATE, ticks=4, repetition=k).recording
        for motion in motions
        for k in (1, 2)
    ]


def soft(step, frequency: float) -> Decision:
    (decision,) = step.judge([Candidate(JointElasticity(), Member(0, (frequency, 0.3)))])
    assert decision.accepted
    return decision


@pytest.mark.slow
def test_what_noise_in_positions_and_torque_could_make_has_to_be_there_further_down(monkeypatch: pytest.MonkeyPatch):
    """A servo on 16 bits per turn made of a rigid shoulder a gear of 1557 +- 276 N m/rad, of which 58 % was left without the noise."""
    # What of the noise is in the torque decides how much of it the check beside this one sees.
    monkeypatch.setattr(noise_check, "made_by_noise", lambda *_: None)
    step = step_beside(on_coarse_encoders(), bands=(25.0, 25.0))
    decision = soft(step, 9.0)
    # Cauchy and Schwarz: noise alone removes no more than its share of the column.
    share = noise_of_column(step, decision)
    assert 0.1 < decision.gain <= share
    said = noise_objection(step, decision)
    assert said is not None
    assert "through the controller's reaction: below 8.8 Hz it has" in said
    # What removes more is not asked, as noise could not make it.
    assert noise_objection(step, replace(decision, gain=1.01 * share)) is None


@pytest.mark.slow
def test_a_soft_gear_is_there_further_down_on_coarse_encoders_too():
    step = step_beside(on_coarse_encoders("joint_elasticity:joint1:stiffness=20000"), bands=(25.0, 25.0))
    decision = soft(step, 14.0)
    assert made_through_the_controller(step, replace(decision, gain=0.0)) is None
    # Of a resonance that is elsewhere it is another in each part of the band.
    assert made_through_the_controller(step, replace(soft(step, 6.0), gain=0.0)) is not None


def test_recordings_too_short_for_the_lower_part_of_a_band_say_nothing_of_it():
    """Of a check it would have been the end of the diagnosis: nothing is left of 3000 samples."""
    step = step_beside(exact_runs(), bands=(0.5, 0.5))
    assert noise_check._examined_below(step, Candidate(Spring(), Member(0)), 0.9) is not None
    assert noise_check._examined_below(step, Candidate(Spring(), Member(0)), CRITERIA.lower_band) is None
