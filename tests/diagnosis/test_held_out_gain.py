"""What effects found change on recordings held out, and what is said where those speak against one."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from scara_ident.diagnosis import Diagnosis, diagnose
from scara_ident.diagnosis.evidence import Evidence
from scara_ident.diagnosis.held_out_gain import HeldOutGain, held_out_gains, spoken_against, words_against
from scara_ident.diagnosis.selection_step import observed
from scara_ident.effects.friction import PositionDependentFriction
from scara_ident.effects.measurement import TimeDelay
from scara_ident.estimation.observations import Observations
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.html.diagnosis import DiagnosisContext, _effect_words
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.diagnosis.made import BANDS, NOISE, multisine


def runs(name: str, seed: int, effects: tuple[str, ...], count: int = 2) -> list[Recording]:
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    own, motion = [parse_effect(text) for text in effects], multisine(name, seed, 6.0, 0.8)
    return [
        simulate(arm, motion, effects=own, seed=seed, repetition=k, rate=250.0).recording for k in range(1, count + 1)
    ]


UNEVEN, DELAY = "position_dependent_friction:joint1:share=0.5", "time_delay:delay=0.012"


@lru_cache
def found(effect: str, *held: str) -> Diagnosis:
    """One effect in what is fitted, and some in what is held out."""
    fitted = [run for seed in (2, 3, 4, 5) for run in runs(f"m{seed}", seed, (effect,))]
    held_out = runs("other", 7, held)
    catalogue = (PositionDependentFriction(), TimeDelay())
    return diagnose(load_robot(), fitted, model="basic", validation=held_out, bands=BANDS, catalogue=catalogue)


def errors(observations: Observations, value: np.ndarray) -> np.ndarray:
    """Rms by joint, row by row."""
    left = [rows.table[-1] - value[rows.columns] @ rows.table[:-1] for rows in observations.joints]
    return np.array(
        [np.sqrt(own @ own / np.sum(rows.counts)) for own, rows in zip(left, observations.joints, strict=True)]
    )


@pytest.mark.parametrize("effect", [UNEVEN, DELAY])
def test_an_effect_that_is_there_in_both_removes_most_of_what_is_held_out(effect: str):
    result = found(effect, effect)
    (item,) = result.effects
    assert item.held_out is not None
    assert not item.held_out.against()
    assert 0.5 < item.held_out.share < item.gain
    said = repr(_effect_words(item, DiagnosisContext(result))[0])
    assert f"On recordings that no choice has seen it removes {item.held_out.share:.0%}." in said
    assert any(line.startswith(f"Found {item.effect}") for line in diagnosis_dict(result)["summary"])


def test_the_error_without_it_is_that_of_a_fit_of_all_else_to_what_was_fitted():
    result = found(UNEVEN, UNEVEN)
    (effect,) = result.effects
    gain = effect.held_out
    assert gain is not None
    # Of the training rows without the effect, weighted by what each joint leaves; by rows, not by factors.
    rest = observed(result.search.step.without(0))
    weights = np.ones(2)
    value = np.zeros(rest.parameters)
    for _ in range(4):
        stacked, torque = np.zeros((0, rest.parameters)), np.zeros(0)
        for weight, rows in zip(weights, rest.joints, strict=True):
            own = np.zeros((rows.table.shape[1], rest.parameters))
            own[:, rows.columns] = rows.table[:-1].T
            stacked, torque = np.vstack([stacked, weight * own]), np.append(torque, weight * rows.table[-1])
        value = np.linalg.lstsq(stacked, torque, rcond=None)[0]
        weights = 1.0 / errors(rest, value)
    held = result.validation_after
    without = errors(held, np.concatenate([value, np.zeros(len(result.after.value) - len(value))]))
    whole = errors(held, result.after.value)
    assert gain.without == pytest.approx(without[0], rel=1e-3)
    assert gain.rms == pytest.approx(whole[0], rel=1e-9)
    rows = np.array([np.sum(joint.counts) for joint in held.joints])
    before, after = ((result.after.weights * own) ** 2 * rows for own in (without, whole))
    removed = np.sum(before - after)
    assert gain.share == pytest.approx(removed / (removed + after[0]), rel=1e-3)


def test_one_that_is_not_there_in_what_is_held_out_is_in_doubt():
    result = found(DELAY)
    (item,) = result.effects
    gain = item.held_out
    assert gain is not None
    assert gain.against()
    assert gain.rms > gain.without
    assert result.verdict == "undecided"
    content = diagnosis_dict(result)
    (place,) = [k for k, line in enumerate(content["summary"]) if line.startswith("In doubt: time_delay: ")]
    words = words_against(gain, "N m")
    assert content["summary"][place + 1] == f"Not borne out: {words}; record further motions to fit."
    assert [item["held_out_gain"] for item in content["effects"]] == [gain.share]
    assert f"It is not borne out: {words}." in repr(_effect_words(item, DiagnosisContext(result))[0])


def test_without_recordings_held_out_nothing_is_said():
    result = found(UNEVEN, UNEVEN)
    none = replace(result.validation_after, data=replace(result.validation_after.data, recordings=()))
    assert held_out_gains(result.search, result.after, none, result.validation_before) == {}
    alone = replace(result, effects=(replace(result.effects[0], held_out=None),))
    assert [item["held_out_gain"] for item in diagnosis_dict(alone)["effects"]] == [None]
    assert "no choice has seen" not in repr(_effect_words(alone.effects[0], DiagnosisContext(alone))[0])


def test_what_was_shown_is_taken_back_on_the_joint_that_is_worse_and_only_there():
    shown = tuple(Evidence(joint, True, "whiteness", "white", 0.05) for joint in ("joint1", "joint2"))
    worse, slightly = HeldOutGain(-0.2, "joint2", 0.1, 0.15), HeldOutGain(-0.04, "joint1", 0.1, 0.101)
    one, other = spoken_against(shown, {"spring of joint1": worse, "base_tilt": slightly})
    assert one == shown[0]
    assert (other.shown, other.by) == (False, "")
    assert other.why == (
        "spring of joint1: on the recordings held out joint2 has an error of 0.15 with it and 0.1 without it"
    )
