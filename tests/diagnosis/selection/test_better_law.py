"""An effect's law, chosen again beside effects that came in after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.better_law import by_better_law
from scara_ident.diagnosis.selection.search import Search
from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.position import Spring
from tests.arms import noisy
from tests.diagnosis.made import NOISE, exact_runs, searched, step_beside, with_torque

LAW_2 = Candidate(Stribeck(2), Member(0, (0.15,)))


def search_with(exponent: int, noise: float) -> Search:
    """What a search would hold that let a friction that falls with speed in by the law of its name, and a spring after it."""

    def added(motion):
        return 0.1 * np.sign(motion.v[0]) * np.exp(-(np.abs(motion.v[0] / 0.15) ** exponent)) + 0.3 * motion.q[0]

    rng = np.random.default_rng(5)
    runs = [noisy(run, rng, noise * np.array(NOISE)) for run in with_torque(exact_runs(), 0, added)]
    step = tune(step_beside(runs, [LAW_2, Candidate(Spring(), Member(0))], 1.0 / (noise * np.array(NOISE))))
    return replace(searched(runs), step=step)


@pytest.mark.parametrize(("exponent", "noise", "told"), [(1, 0.3, 1), (2, 0.3, None), (1, 20.0, None)])
def test_an_effect_goes_over_to_its_other_law_where_that_explains_more(exponent, noise, told):
    """Beside a tilt that was found later a gear's loss kept the law of second order, and a weight was 15 standard deviations off."""
    found = search_with(exponent, noise)
    better = by_better_law(found, found.step.weights)
    if told is None:
        assert better is None
        return
    assert better is not None
    assert [item.effect for item in better.chosen] == [Stribeck(told), Spring()]
    # As it was fitted by it, and for good.
    assert np.sum(better.step.model.squares) < np.sum(found.step.model.squares)
    assert better.chosen[0].member.nonlinear == pytest.approx((0.15,), rel=0.1)
    assert by_better_law(better, better.step.weights) is None


def test_effects_with_one_law_stay_as_they_are():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.3 * motion.q[0])
    found = searched(runs, Spring())
    assert len(found.chosen) == 1
    assert by_better_law(found, found.step.weights) is None
