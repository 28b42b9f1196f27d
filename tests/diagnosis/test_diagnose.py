"""The whole diagnosis on short recordings of the virtual SCARA03."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.candidates import columns_at_hand
from scara_ident.diagnosis.evidence.outcome import outcome_of
from scara_ident.diagnosis.selection.other_bands import in_bands_of
from scara_ident.effects import CATALOGUE, Coefficient, Effect, effects_named
from scara_ident.effects.friction import AsymmetricFriction, Stribeck
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.effects.position import Spring
from scara_ident.errors import ArgumentError, UsageError
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import (
    BANDS,
    RATE,
    complete,
    exact_runs,
    held_out_run,
    runs_that_repeat,
    virtual_runs,
    with_torque,
)

pytestmark = pytest.mark.slow

ROBOT = load_robot()
DELAYS = (TimeDelay(), Spring(), Stribeck(), AsymmetricFriction())


@dataclass(frozen=True)
class Lobes(Effect):
    """A user's own effect: two lobes per turn of the joint."""

    name = "lobes"
    summary = "two lobes per turn"
    coefficients = (Coefficient("size", "N m", "lobes", "it would pull"),)

    def signal_columns(self, signals, member):
        return [np.sin(2.0 * signals.motion.q[member.place])]


def test_a_clean_set_is_complete():
    result = diagnose(ROBOT, virtual_runs())
    assert (result.verdict, result.effects, result.unexplained) == ("complete", (), None)
    # The base model as it was: nothing is fitted or observed again.
    assert result.after is result.before
    assert result.training_after is result.training_before
    assert [fit.joint for fit in result.fit_after] == ["joint1", "joint2"]


def test_a_clean_formula_is_complete():
    result = diagnose(ROBOT, exact_runs())
    assert (result.verdict, result.effects, result.unexplained) == ("complete", (), None)


def test_reversals_of_a_clean_arm_are_not_taken_for_ripple():
    runs = virtual_runs(seconds=(6.0, 7.0))
    assert diagnose(ROBOT, runs, bands=BANDS, catalogue=(TorqueRipple(),)).verdict == "complete"


@pytest.fixture(scope="module")
def spring():
    return diagnose(ROBOT, virtual_runs("spring:joint1"), validation=[held_out_run("spring:joint1")], bands=BANDS)


def test_a_spring_is_found_with_its_stiffness_and_lowers_the_error_held_out(spring):
    (effect,) = spring.effects
    assert (spring.verdict, effect.effect, effect.joint) == ("explained", "spring", "joint1")
    told = effect.parameters["stiffness"]
    assert told.value == pytest.approx(0.0512, rel=0.05)
    assert effect.p_value < 1e-6
    assert effect.votes == (2, 2)
    assert effect.before["joint1"] > 2.0 * effect.after["joint1"]
    old = rms_of(spring.before.value, spring.validation_before)
    new = rms_of(spring.after.value, spring.validation_after)
    assert new[0] < 0.6 * old[0]
    assert new[1] == pytest.approx(old[1], rel=0.2)


def test_lack_of_fit_is_there_before_and_gone_after(spring):
    assert spring.fit_before[0].missing > 3.0 * spring.fit_before[0].noise
    assert spring.fit_after[0].missing < spring.fit_after[0].noise


def test_recordings_held_out_take_no_part(spring):
    other = held_out_run("spring:joint1")
    wild = replace(other, name="W_1", trajectory="W", effort=3.0 * other.effort + 1.0)
    result = diagnose(ROBOT, virtual_runs("spring:joint1"), validation=[wild], bands=BANDS)
    assert_array_equal(result.after.value, spring.after.value)
    assert [effect.parameters for effect in result.effects] == [effect.parameters for effect in spring.effects]
    assert result.search.bands == spring.search.bands
    # They choose nothing, but where the model does not hold on them nothing is shown to be noise.
    assert (spring.verdict, result.verdict) == ("explained", "undecided")
    assert any("held-out recordings is" in item.why for item in result.evidence)
    assert rms_of(result.after.value, result.validation_after) != rms_of(spring.after.value, spring.validation_after)


def test_the_band_is_not_chosen_on_recordings_held_out():
    train = virtual_runs()
    wild = replace(train[0], name="W_1", trajectory="W", effort=train[0].effort[:, ::-1].copy())
    alone = diagnose(ROBOT, train, catalogue=())
    beside = diagnose(ROBOT, train, validation=[wild], catalogue=())
    assert alone.search.bands == beside.search.bands


def test_a_name_in_the_catalogue_is_said_to_be_no_effect():
    with pytest.raises(ArgumentError, match="catalogue: expected effects, as effects_named gives; found 'spring'"):
        diagnose(ROBOT, exact_runs(), catalogue=["spring"])


def test_a_recording_cannot_be_fitted_and_held_out():
    with pytest.raises(UsageError, match="held out"):
        diagnose(ROBOT, exact_runs(), validation=exact_runs()[:1], bands=BANDS)


def test_a_users_own_effect_is_found_beside_the_catalogue():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(2.0 * motion.q[1]))
    result = diagnose(ROBOT, runs, bands=BANDS, catalogue=(*CATALOGUE, Lobes()))
    (effect,) = result.effects
    assert (effect.effect, effect.joint, effect.description) == ("lobes", "joint2", "two lobes per turn")
    size = effect.parameters["size"]
    assert abs(size.value - 0.03) < 4.0 * size.std
    assert result.verdict == "explained"


def test_what_no_effect_of_the_catalogue_explains_is_said_with_joint_signals_and_size():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    result = diagnose(ROBOT, runs, bands=BANDS, catalogue=())
    assert (result.verdict, result.effects) == ("unexplained", ())
    assert result.unexplained.joint == "joint2"
    assert result.unexplained.signals == ("position of joint2",)
    assert result.unexplained.rms == pytest.approx(0.03 / np.sqrt(2.0), rel=0.2)
    # 0.05 periods per motor turn: nothing said that none so slow is looked for.
    assert any(
        note.startswith("joint2: what repeats with the motor's angle is looked for from 0.4") for note in result.notes
    )


def test_a_remainder_is_seen_by_repetition_where_no_signal_shows_it():
    rng = np.random.default_rng(0)
    shape = np.cumsum(rng.standard_normal((2, 4000)), axis=1)
    hidden = {name: 0.03 * np.sin(0.1 * shape[k]) for k, name in enumerate("AB")}
    runs = [
        replace(run, effort=run.effort + np.array([[1.0], [0.0]]) * hidden[run.trajectory][: run.effort.shape[1]])
        for run in exact_runs()
    ]
    result = diagnose(ROBOT, runs, bands=BANDS, catalogue=())
    assert result.verdict == "unexplained"
    assert result.unexplained.joint == "joint1"


def test_less_than_a_sample_of_delay_is_a_note_and_not_an_effect():
    late = [shifted(run, -0.4 / RATE) for run in exact_runs()]
    result = diagnose(ROBOT, late, bands=BANDS, catalogue=DELAYS)
    assert result.effects == ()
    assert result.verdict == "complete"
    assert any("less than one sample" in note for note in result.notes)
    assert result.search.correction.value[0] == pytest.approx(0.4 / RATE, abs=2e-4)


def test_a_longer_delay_is_an_effect_and_is_corrected_in_what_is_held_out():
    late = "time_delay:delay=0.005"
    result = diagnose(ROBOT, virtual_runs(late), validation=[held_out_run(late)], bands=BANDS, catalogue=DELAYS)
    (effect,) = result.effects
    assert (effect.effect, effect.joint) == ("time_delay", None)
    assert effect.parameters["delay"].value == pytest.approx(0.005, abs=1e-3)
    old = rms_of(result.before.value, result.validation_before)
    assert rms_of(result.after.value, result.validation_after)[0] < 0.8 * old[0]


def test_a_model_can_be_given_and_progress_is_reported():
    told: list[tuple[str, float]] = []
    result = diagnose(
        ROBOT, exact_runs(), model=complete(), bands=BANDS, catalogue=(), progress=lambda *step: told.append(step)
    )
    assert result.before.model.name == "complete"
    assert [step for step, _ in told[-2:]] == [
        "testing what is left", "comparing the effects found with their alternatives",
    ]  # fmt: skip
    shares = [done for _, done in told]
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < shares[-1] < 1.0


def test_no_share_of_the_work_is_smaller_than_one_before_where_a_search_is_repeated():
    """Bands move, effects come in, and another band is chosen with them."""
    told: list[tuple[str, float]] = []
    diagnose(
        ROBOT,
        virtual_runs("torque_ripple:joint1:order=2,amplitude=0.15"),
        catalogue=effects_named("torque_ripple", "spring"),
        progress=lambda *step: told.append(step),
    )
    shares = [done for _, done in told]
    assert shares == sorted(shares)
    assert shares[-1] <= 1.0
    assert sum(step.startswith("trying") for step, _ in told) > 1


def test_without_a_reduction_ripple_of_the_motor_is_not_looked_for_and_that_is_said():
    runs = runs_that_repeat(0.1)
    for reduction, slides, said in ((1.0, False, True), (1.0, True, True), (100.0, True, False)):
        robot = replace(load_robot(), reduction=np.full(2, reduction), prismatic=np.array([slides, False]))
        found = diagnose(robot, runs, bands=BANDS, catalogue=(Spring(),))
        assert found.unexplained is not None and found.unexplained.joint == "joint1"
        notes = [note for note in found.notes if note.startswith("joint1: no reduction is stated")]
        assert len(notes) == said
        assert all(note.endswith("over its pole pitch)") is slides for note in notes)


def test_what_a_lower_band_determines_is_of_one_model_and_what_is_left_is_judged_where_it_was_found(monkeypatch):
    """Above a band of 4.8 Hz a line of the elastic gears, which stood in none of 23 Hz, made an explained arm undecided."""
    module, seen = sys.modules[diagnose.__module__], []

    def lower(task, outcome):
        step = outcome.search.step
        columns = step.columns.at((8.0, 8.0))
        scene = replace(step.scene, band=8.0, columns=columns_at_hand(columns.observations))
        return outcome_of(task, in_bands_of(outcome.search, replace(step, scene=scene, columns=columns)))

    monkeypatch.setattr(module, "below_position_noise", lower)
    weighed = module.weighed_evidence

    def witnessed(outcome, held, *others):
        seen.append((outcome, held))
        return weighed(outcome, held, *others)

    monkeypatch.setattr(module, "weighed_evidence", witnessed)
    runs, held = virtual_runs("spring:joint2:stiffness=0.3"), held_out_run("spring:joint2:stiffness=0.3")
    result = diagnose(ROBOT, runs, validation=[held], catalogue=(Spring(), Stribeck()))
    ((outcome, there),) = seen
    assert [item.label for item in result.effects] == ["spring of joint2"]
    for rows in (result.training_before, result.training_after, result.validation_before, result.validation_after):
        assert rows.data.bands == (8.0, 8.0)
    assert result.search.bands == (8.0, 8.0)
    found = result.effects[0].parameters["stiffness"]
    place = result.before.model.columns
    assert (found.value, found.std) == (result.after.value[len(place)], result.after.std[len(place)])
    assert min(outcome.search.bands) > 8.0
    assert outcome.training.data.bands == outcome.residuals.data.bands == there.after.data.bands == outcome.search.bands
    assert any(note.startswith("all parameters are estimated below 8 Hz") for note in result.notes)
    # Bands that were asked for are kept.
    assert diagnose(ROBOT, runs, bands=BANDS, catalogue=(Spring(),)).search.bands == BANDS
