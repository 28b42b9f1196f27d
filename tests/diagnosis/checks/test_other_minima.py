"""Effects that act together: fits begun again elsewhere, and standard deviations that hold what the fit may have taken up."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache, lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.other_laws import parameters_of_laws
from scara_ident.diagnosis.checks.other_minima import _below, as_good, lowest, quieter, widened
from scara_ident.diagnosis.fitting.effect_parameters import physical_parameters
from scara_ident.diagnosis.fitting.linearised import linearise
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.effects import Member, Parameter
from scara_ident.effects.elasticity import JointElasticity
from scara_ident.effects.position import Spring
from scara_ident.recording.recording import Recording
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from tests.diagnosis.made import NOISE, exact_runs, multisine, step_beside, with_torque

FAMILY = JointElasticity()


@lru_cache(maxsize=2)
def elastic_runs(first: int, second: int) -> tuple[Recording, ...]:
    """Runs of the virtual SCARA03 with both joints elastic, N m/rad."""
    arm = replace(virtual_arm(), torque_noise=np.array(NOISE))
    effects = [parse_effect(f"joint_elasticity:joint{j}:stiffness={k}") for j, k in ((1, first), (2, second))]
    return tuple(
        simulate(arm, multisine(f"F{k}", k, 9.0), effects=effects, seed=k, rate=250.0).recording for k in (1, 2, 3)
    )


def stiffnesses(step: SelectionStep) -> list[float]:
    """Of a model of elastic joints alone, N m/rad."""
    return [1.0 / FAMILY.tie(step.scene, item.member).value for item in step.chosen]


def test_a_single_effect_is_fitted_once(monkeypatch: pytest.MonkeyPatch):
    step = step_beside(
        with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1]), [Candidate(Spring(), Member(1))]
    )
    fits = []
    monkeypatch.setattr(sys.modules[lowest.__module__], "tune", lambda step, **_: fits.append(step) or step)
    assert lowest(step) is step and len(fits) == 1
    assert list(as_good(step)) == [] and len(fits) == 1
    # One of several kinds that act together is no several.
    beside = replace(step, chosen=(*step.chosen, Candidate(FAMILY, Member(0, (9.0, 0.1)))))
    assert lowest(beside) is beside and len(fits) == 2


def test_what_a_fit_as_good_differs_by_is_one_more_standard_deviation():
    own = {"stiffness": Parameter(900.0, 30.0, "N m/rad"), "frequency": Parameter(3.0, 0.1, "Hz")}
    found = widened(own, {"stiffness": Parameter(940.0, 5.0, "N m/rad")})
    assert found == {**own, "stiffness": Parameter(900.0, 50.0, "N m/rad")}


@pytest.mark.slow
def test_a_fit_that_ended_in_another_minimum_ends_in_the_lowest():
    """Of two joints of 900 and 2400 N m/rad the second was 1263 with a standard deviation of 363, and 1066 from here."""
    chosen = [Candidate(FAMILY, Member(0, (3.1, 0.02))), Candidate(FAMILY, Member(1, (4.0, 0.15)))]
    step = step_beside(elastic_runs(900, 2400), chosen, bands=(13.0, 13.0))
    wrong, right = tune(step), lowest(step)
    assert stiffnesses(wrong)[1] < 1500.0
    assert linearise(right).error < 0.5 * linearise(wrong).error
    assert stiffnesses(right) == pytest.approx([900.0, 2400.0], rel=0.01)
    # From there no other is as good.
    told, own = parameters_of_laws(right).effects, physical_parameters(right).effects
    for mine, its in zip(told, own, strict=True):
        assert mine["stiffness"].std < 2.0 * its["stiffness"].std


def test_fits_begin_where_those_of_the_same_effects_ended(monkeypatch: pytest.MonkeyPatch):
    step = step_beside(exact_runs(), [Candidate(FAMILY, Member(j, (9.0 - j, 0.1))) for j in (0, 1)])
    begun, recordings = [], []

    def tuned(step: SelectionStep, **_: bool) -> SelectionStep:
        begun.append([item.member.nonlinear[0] for item in step.chosen])
        recordings.append(len(step.observations.data.recordings))
        return step

    def error(step: SelectionStep) -> SimpleNamespace:
        first, second, *_ = (item.member.nonlinear[0] for item in step.chosen)
        return SimpleNamespace(error=30.0 if first < 9.0 else 10.0 + first - 9.0 + 3.0 * abs(second - 8.0))

    module = sys.modules[lowest.__module__]
    monkeypatch.setattr(module, "tune", tuned)
    monkeypatch.setattr(module, "present_model", error)
    best = lowest(step)
    assert begun[:5] == [[9.0, 8.0], [5.625, 8.0], [14.4, 8.0], [9.0, 5.0], [9.0, 12.8]]
    # Those that leave twice as much are no rivals; the others are fitted to all recordings too.
    rivals = [[item.member.nonlinear[0] for item in each] for each in best.minima]
    assert rivals == [[9.0, 8.0], [14.4, 8.0], [9.0, 5.0]]
    assert begun[5:] == rivals[1:]
    assert recordings[0] == 4 and max(recordings[1:5]) < 4 and recordings[5:] == [4, 4]
    monkeypatch.setattr(module, "_below", lambda _: None)
    begun.clear()
    assert list(as_good(best)) == []
    assert begun[:2] == rivals[1:] and all(len(each) == 3 for each in begun[2:])
    begun.clear()
    # Of other effects they say nothing.
    list(as_good(replace(best, chosen=best.chosen[::-1])))
    assert begun[:4] == [[5.0, 9.0], [12.8, 9.0], [8.0, 5.625], [8.0, 14.4]]


@pytest.mark.slow
def test_what_differs_in_the_lower_part_of_the_band_is_in_the_standard_deviation(monkeypatch: pytest.MonkeyPatch):
    """The noise of positions made a second gear of 3620 N m/rad with a standard deviation of 831 where 16,600 was true."""
    chosen = [Candidate(FAMILY, Member(0, (2.8, 0.03))), Candidate(FAMILY, Member(1, (8.9, 0.03)))]
    step = tune(step_beside(elastic_runs(900, 2400), chosen, bands=(13.0, 13.0)))
    own = physical_parameters(step).effects[1]["stiffness"]
    softer = replace(step, chosen=(step.chosen[0], step.chosen[1].at((6.0, 0.03))))
    module = sys.modules[lowest.__module__]
    monkeypatch.setattr(module, "_alternatives", lambda _: [])
    # Of the same fits each time.
    monkeypatch.setattr(sys.modules[parameters_of_laws.__module__], "physical_parameters", cache(physical_parameters))
    for below, far in ((softer, True), (step, False), (None, False)):
        monkeypatch.setattr(module, "_below", lambda _, below=below: below)
        told = parameters_of_laws(step).effects[1]["stiffness"]
        assert told.value == own.value
        assert (told.std > 900.0) == far and (told.std == own.std) != far


def test_the_lower_part_of_the_band_ends_where_what_lags_has_no_noise(monkeypatch: pytest.MonkeyPatch):
    """In 23 Hz three gears of 12, 15 and 6 kN m/rad were 10.5 +- 0.4, 14.2 +- 0.2 and 6.7 +- 0.2: of accelerations little was noise."""
    step = step_beside(
        exact_runs(1, 1), [Candidate(FAMILY, Member(j, (9.0 - j, 0.1))) for j in (0, 1)], bands=(20.0, 20.0)
    )
    module = sys.modules[lowest.__module__]
    monkeypatch.setattr(module, "tune", lambda step: step)
    share = step.criteria.lower_band**0.5
    for quiet, steps in ((15.0, 1), (11.0, 2), (5.0, 3)):
        monkeypatch.setattr(
            module, "noisy", lambda data, derivatives=0, quiet=quiet: derivatives > 0 and max(data.bands) >= quiet
        )
        found = _below(step)
        assert found is not None
        assert found.observations.data.bands == pytest.approx([20.0 * share**steps] * 2)
        assert found.scene.band == pytest.approx(20.0 * share**steps)
    # Recordings too short for a band are looked at in the next wider one.
    monkeypatch.setattr(module, "noisy", lambda data, derivatives=0: max(data.bands) >= 0.1)
    assert 0.1 < _below(step).observations.data.bands[0] < 5.0
    monkeypatch.setattr(module, "noisy", lambda data, derivatives=0: False)
    assert _below(step) is None


@pytest.mark.parametrize("count", [1, 2])
def test_what_noise_moves_is_determined_where_there_is_none(count: int, monkeypatch: pytest.MonkeyPatch):
    """Three gears of 12, 15 and 6 kN m/rad were 10.5 +- 2, 14.3 +- 0.6 and 6.7 +- 0.4; below 5 Hz 12.0 +- 0.1, 15.0 +- 0.4 and 6.2 +- 0.2.

    One of 6679 was 6690 +- 46 in 13 Hz and 6159 +- 71 below 5 Hz, which no noise had to do with.
    """
    chosen = [Candidate(FAMILY, Member(j, (9.0 - j, 0.1))) for j in range(count)]
    step = step_beside(exact_runs(1, 1), chosen)
    below, module = replace(step), sys.modules[lowest.__module__]
    values = {id(step): (10.7, 0.1), id(below): (12.0, 0.2), id(step.noisier): (10.2, 0.1)}

    def parameters(each: SelectionStep, **_: bool) -> SimpleNamespace:
        own = {"stiffness": Parameter(*values[id(each)], "kN m/rad")}
        return SimpleNamespace(effects=tuple(dict(own) for _ in each.chosen))

    monkeypatch.setattr(module, "physical_parameters", parameters)
    monkeypatch.setattr(module, "tune", lambda each: each)
    monkeypatch.setattr(module, "noisy", lambda *_: False)
    monkeypatch.setattr(module, "size_is_determined", lambda *_: True)
    monkeypatch.setattr(module, "_below", lambda _: below)
    assert quieter(step) is below
    # Not where that is noisy too, or tells not all that was found, nor where there is none.
    for name, instead in (("noisy", True), ("size_is_determined", False), ("_below", None)):
        with monkeypatch.context() as context:
            context.setattr(module, name, lambda *_, instead=instead: instead)
            assert quieter(step) is None
    # Nor where noise moves it by no more than chance, or towards what is told below; nor where both are the same.
    for noisier, there in (((10.6, 0.1), (12.0, 0.2)), ((11.2, 0.1), (12.0, 0.2)), ((10.2, 0.1), (11.0, 0.2))):
        values[id(step.noisier)], values[id(below)] = noisier, there
        assert quieter(step) is None


@pytest.mark.slow
def test_what_one_takes_up_of_another_that_was_not_found_is_in_its_standard_deviation():
    """One alone was sure of 5518 N m/rad to 45 where 6000 is true, beside one of 12,000 that recordings show little of."""
    step = tune(step_beside(elastic_runs(6000, 12000), [Candidate(FAMILY, Member(0, (7.0, 0.05)))], bands=(12.0, 12.0)))
    (own,), (told,) = physical_parameters(step).effects, parameters_of_laws(step).effects
    assert abs(own["stiffness"].value - 6000.0) > 5.0 * own["stiffness"].std
    assert told["stiffness"].value == own["stiffness"].value
    assert abs(told["stiffness"].value - 6000.0) < 2.0 * told["stiffness"].std


def test_what_ended_in_the_same_minimum_is_no_confounder(monkeypatch: pytest.MonkeyPatch):
    step = step_beside(exact_runs(1, 1), [Candidate(FAMILY, Member(j, (9.0 - j, 0.1))) for j in (0, 1)])

    def tuned(step: SelectionStep, **_: bool) -> SelectionStep:
        # Whatever began faster comes back, all but a little.
        first, second = step.chosen
        return replace(step, chosen=(first.at([9.1, 0.098]), second)) if first.member.nonlinear[0] > 10.0 else step

    module = sys.modules[lowest.__module__]
    monkeypatch.setattr(module, "tune", tuned)
    monkeypatch.setattr(module, "present_model", lambda _: SimpleNamespace(error=10.0))
    best = lowest(step)
    assert [[item.member.nonlinear[0] for item in each] for each in best.minima] == [
        [9.0, 8.0], [5.625, 8.0], [9.0, 5.0], [9.0, 12.8]
    ]  # fmt: skip
