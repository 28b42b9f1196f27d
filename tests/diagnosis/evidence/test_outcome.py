"""What a search leaves, and when that is a remainder."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.evidence.evidence import coloured_shares
from scara_ident.diagnosis.evidence.outcome import Outcome, outcome_of, undetermined, with_parameters
from scara_ident.diagnosis.fitting.effect_parameters import PhysicalParameters
from scara_ident.diagnosis.selection.search import SearchTask
from scara_ident.effects import Parameter
from scara_ident.effects.position import Spring
from scara_ident.estimation.run_offsets import rms_of
from tests.diagnosis.made import exact_runs, runs_that_repeat, searched, virtual_runs, with_torque
from tests.diagnosis.test_model_selection import MODEL, selected


def test_where_runs_differ_a_remainder_is_more() -> None:
    """What is left of friction and delays of their own repeated at 1.2 and 1.4 % of the torque, and nothing was missing."""
    runs = with_torque(exact_runs(2, 4), 0, lambda motion: 0.02 * np.sin(6.0 * motion.q[0]))
    differing = [
        with_torque([run], 1, lambda motion, size=size: size * np.sign(motion.v[1]))[0]
        for run, size in zip(runs, np.random.default_rng(3).uniform(-0.02, 0.02, len(runs)), strict=True)
    ]
    outcome = outcome_of(SearchTask(MODEL, ()), searched(differing, bands=(11.0, 11.0)))
    assert outcome.after.variation
    assert set(outcome.after.variation.sizes(MODEL.robot)) == {"joint2"}
    first, second = (item.torque_rms for item in outcome.training.by_joint)
    assert outcome.small == pytest.approx([CRITERIA.min_remainder * first, CRITERIA.min_remainder_of_runs * second])


def test_the_rms_of_a_joint_is_that_of_its_rows() -> None:
    seen = searched(virtual_runs(), bands=(11.0, 11.0)).uncorrected
    value = np.linspace(0.1, 0.2, seen.parameters)
    told = rms_of(value, seen)
    for joint, rms in zip(seen.joints, told, strict=True):
        left = joint.table[-1] - value[joint.columns] @ joint.table[:-1]
        assert rms == pytest.approx(np.sqrt(np.sum(left**2) / np.sum(joint.counts)), rel=1e-9)


@pytest.mark.parametrize(("size", "standing_out"), [(0.017, False), (0.024, True)])
def test_what_repeats_is_a_remainder_where_most_of_it_is_not_spread_evenly(size: float, standing_out: bool) -> None:
    """Two of four arms with nothing missing were `unexplained`: of what encoders of 13 and 14 bits left 36 % stood out."""
    runs = runs_that_repeat(0.04, lambda run: size * np.sin(2.6 * np.pi * run.time))
    outcome = selected(runs, Spring(), bands=(11.0, 11.0), free=False)
    share = coloured_shares(outcome.residuals)[0]
    assert share > CRITERIA.min_colour
    assert (share > CRITERIA.colour_of_remainder) == standing_out
    assert (outcome.unexplained is not None) == standing_out


@pytest.mark.parametrize(("size", "unexplained"), [(0.05, False), (0.1, True)])
def test_what_repeats_far_above_noise_is_a_remainder_of_any_colour(size: float, unexplained: bool) -> None:
    """Cogging of 5 N beside 0.2 N of noise was `undecided`: over many speeds it is as even as white noise."""
    runs = runs_that_repeat(size)
    outcome = selected(runs, Spring(), bands=(11.0, 11.0), free=False)
    assert coloured_shares(outcome.residuals)[0] < CRITERIA.min_colour
    (fit,) = [fit for fit in outcome.fit_after if fit.joint == "joint1"]
    assert (fit.missing > CRITERIA.far_above_noise * fit.noise) is unexplained
    assert (outcome.unexplained is not None) is unexplained


@pytest.mark.parametrize(("size", "along"), [(0.07, True), (0.0, False)])
def test_what_goes_as_an_effect_of_no_arm_is_a_remainder_however_small_beside_the_torque(
    size: float, along: bool, monkeypatch
) -> None:
    """A chain on a lift, 98 N/m that push away, was `undecided`: it was small beside the weight, as what filters leave."""
    runs = with_torque(exact_runs(2, 3), 0, lambda motion: -size * motion.q[0])
    # As if it were as small beside the torque as may be left over.
    names = ("remainder", "remainder_of_runs", "min_remainder", "min_remainder_of_runs")
    lenient = replace(CRITERIA, **dict.fromkeys(names, 1.0))
    found = outcome_of(SearchTask(MODEL, (Spring(),), lenient), searched(runs, Spring(), bands=(11.0, 11.0)))
    assert any(item.as_no_arm > CRITERIA.nearly_all for item in found.search.decisions) is along
    assert (found.unexplained is not None) is along


@pytest.mark.parametrize("seed", [1, 6, 7])
def test_steps_of_an_encoder_that_come_again_are_no_remainder(seed: int) -> None:
    """A motion that repeats to less than a step of 13 bits has the same steps again: 3 of 8 sets were `unexplained`, of one draw beside another."""
    rng, step = np.random.default_rng(seed), 2.0 * np.pi / 2**13
    zero = rng.uniform(0.0, step, (2, 1))
    runs = [
        replace(
            run,
            position=step * np.round((run.position + zero) / step) - zero,
            effort=run.effort + 0.002 * rng.standard_normal(run.effort.shape),
        )
        for run in exact_runs()
    ]
    outcome = selected(runs, Spring(), bands=(15.0, 15.0), free=False)
    assert all(fit.p_value < 1e-4 for fit in outcome.fit_after)
    assert outcome.unexplained is None


@pytest.mark.parametrize(
    ("acting", "refused"), [({"first", "second"}, ["second"]), ({"first"}, ["first"]), ({"sure"}, []), (set(), [])]
)
def test_the_least_determined_of_effects_that_act_together_is_refused(acting: set[str], refused: list[str]) -> None:
    """3680 +- 2540 N m/rad on a rigid joint were `explained`, beside 36,330 +- 18,930 of the joint that had a gear of 12,000."""
    parameters = {
        "first": Parameter(36330.0, 18930.0, "N m/rad"),
        "second": Parameter(3680.0, 2540.0, "N m/rad"),
        "sure": Parameter(2000.0, 200.0, "N m/rad"),
    }

    @dataclass(frozen=True)
    class Step:
        chosen: tuple[SimpleNamespace, ...]
        weights: tuple[float, ...] = ()

        def without(self, place: int) -> Step:
            return replace(self, chosen=(*self.chosen[:place], *self.chosen[place + 1 :]))

        def judge(self, candidates: list[SimpleNamespace]) -> list[SimpleNamespace]:
            assert all(item not in self.chosen for item in candidates)
            return [
                SimpleNamespace(label=item.label, refused=lambda why, item=item: (item.label, why))
                for item in candidates
            ]

    chosen = tuple(
        SimpleNamespace(label=name, effect=SimpleNamespace(together=name in acting, nonlinear=()))
        for name in parameters
    )
    blank = dict.fromkeys((each.name for each in fields(Outcome)), None)
    found = Outcome(
        **blank
        | {
            "search": SimpleNamespace(step=Step(chosen)),
            "after": SimpleNamespace(weights=(1.0,)),
            "parameters": PhysicalParameters(tuple({"stiffness": each} for each in parameters.values())),
        }
    )
    assert with_parameters(found) is found
    told = undetermined(found, CRITERIA)
    assert [label for label, _ in told] == refused
    assert all("other fits that explain as much" in why for _, why in told)
