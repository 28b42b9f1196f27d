"""Recordings held out: predicted before and after, and what is local in time there counts for nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from importlib import import_module

import numpy as np
import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.evidence.outcome import Outcome
from scara_ident.diagnosis.held_out.validation import Validation, says_more, validated
from scara_ident.effects.friction import PositionDependentFriction
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.identification.events import Event
from scara_ident.motion.prepared import PreparedData
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import simulate, virtual_arm
from tests.diagnosis.held_out.test_gain import UNEVEN, runs
from tests.diagnosis.made import BANDS, NOISE, multisine
from tests.estimation.test_run_variation import runs as differing_runs


def pushed(run: Recording, size: float) -> Recording:
    """Half a second of a torque on the first joint that no model has."""
    assert run.effort is not None
    effort = run.effort.copy()
    effort[0, (run.time > run.time[0] + 3.0) & (run.time < run.time[0] + 3.5)] += size
    return replace(run, effort=effort)


@lru_cache
def found(size: float) -> Diagnosis:
    """An effect in all runs, and a push in one of those held out."""
    fitted = [run for seed in (2, 3, 4, 5) for run in runs(f"m{seed}", seed, (UNEVEN,))]
    first, *others = [run for seed in (7, 8, 9) for run in runs(f"m{seed}", seed, (UNEVEN,))]
    held_out = [pushed(first, size), *others]
    return diagnose(
        load_robot(), fitted, model="basic", validation=held_out, bands=BANDS, catalogue=(PositionDependentFriction(),)
    )


@pytest.mark.slow
def test_a_push_says_nothing_of_an_effect():
    """Its stretch counted as what moments of motions differ by."""
    usual, disturbed = found(0.0), found(3.0)
    assert not usual.events
    (event,) = disturbed.events
    assert event.held_out
    assert abs(event.start - 3.0) < 0.2
    assert abs(event.stop - 3.5) < 0.2
    own, other = (result.effects[0].held_out for result in (usual, disturbed))
    assert own is not None
    assert other is not None
    assert abs(other.size - own.size) < 0.5 * own.std
    assert other.std < 1.1 * own.std
    assert other.borne_out()


def test_beside_what_stays_unexplained_a_whole_recording_is_named_for_a_reason_or_for_errors_beyond_its_torque():
    whole = Event("run", 0.0, 12.0, ("joint1",), 0.5, "unknown", held_out=True)
    assert not says_more(whole)
    for other in (replace(whole, kind="other payload"), replace(whole, score=3.0), replace(whole, beyond=("joint1",))):
        assert says_more(other)


@pytest.mark.slow
def test_errors_are_of_all_that_was_recorded():
    """What is left out for the evidence stays in the figures that are given."""
    usual, disturbed = found(0.0), found(3.0)
    before, after = (rms_of(item.after.value, item.validation_after)[0] for item in (usual, disturbed))
    assert before is not None
    assert after is not None
    assert after > 2.0 * before
    assert disturbed.evidence == usual.evidence


@pytest.mark.slow
def test_the_base_model_is_predicted_beside_it():
    result = found(0.0)
    assert result.validation_before.model is result.before.model
    assert result.validation_after.parameters > result.validation_before.parameters
    before = rms_of(result.before.value, result.validation_before)
    after = rms_of(result.after.value, result.validation_after)
    assert before[0] is not None
    assert after[0] is not None
    assert after[0] < 0.9 * before[0]
    assert np.array_equal(result.validation_before.owner, result.validation_after.owner)


def test_of_one_recording_runs_are_not_known_to_differ():
    """`complete` with 9 times the error on what was held out, "which the differences between runs explain": one run, and no number to compare with."""
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    fitted, other = (
        simulate(arm, multisine(f"m{seed}", seed, 30.0, 0.8), seed=seed, rate=250.0).recording for seed in (2, 7)
    )
    assert other.effort is not None
    held_out = [replace(other, effort=1.1 * other.effort)]
    result = diagnose(
        load_robot(),
        [fitted],
        model="basic",
        validation=held_out,
        bands=BANDS,
        catalogue=(PositionDependentFriction(),),
    )
    assert all("times the training error" in item.why for item in result.evidence)
    assert result.verdict == "undecided"


@pytest.mark.slow
def test_what_runs_differ_by_excuses_no_error_that_is_none_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """`complete` stood beside 2.9 times the training's error, "which the differences between runs explain": in delays, of which it was none."""
    seen: list[Validation] = []

    def kept(outcome: Outcome, data: PreparedData) -> Validation:
        seen.append(validated(outcome, data))
        return seen[-1]

    monkeypatch.setattr(import_module("scara_ident.diagnosis.diagnose"), "validated", kept)
    different = (0.06, 0.02, 0.0, 0.0)
    training = differing_runs(np.random.default_rng(3), different, count=8, seconds=8.0)
    plain = differing_runs(np.random.default_rng(6), different, count=3, seconds=8.0)
    # A torque over the angle, which is no kind of difference.
    lacking = [replace(run, effort=run.effort + 0.1 * np.sin(6.0 * run.position)) for run in plain]
    for held_out in (plain, lacking):
        diagnose(
            load_robot(),
            training,
            model="basic",
            validation=held_out,
            bands=BANDS,
            catalogue=(PositionDependentFriction(),),
        )
    before, after = seen
    assert np.all(before.apart > 0.0)
    assert not np.any(after.apart)
    assert not any(event.kind == "unknown" for event in before.events)
    assert {event.kind for event in after.events} == {"unknown"}
