"""What came in early goes again for what explains more in its place, and for nothing less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.selection.exchange import best_exchange, near_in_place, needed, without_superfluous
from scara_ident.effects import Member
from scara_ident.effects.friction import AsymmetricFriction, Stribeck
from scara_ident.effects.measurement import TimeDelay, shifted
from scara_ident.effects.position import Spring
from tests.diagnosis.made import Bent, Bump, exact_runs, searched, step_beside, with_torque

SPRING, ASYMMETRIC = Candidate(Spring(), Member(0)), Candidate(AsymmetricFriction(), Member(0))
STIFFNESS, DIFFERENCE = 0.08, 0.05


def both(motion):
    return STIFFNESS * (motion.q[0] - 1.57) + DIFFERENCE * np.abs(motion.v[0])


class Mixture(Spring):
    """A torque that is nearly that of a spring and of friction by direction together."""

    name = "mixture"

    def signal_columns(self, signals, member):
        motion = signals.motion
        return [both(motion) + 0.02 * np.sin(5.0 * motion.q[0])]


MIXTURE = Candidate(Mixture(), Member(0))


@pytest.fixture(scope="module")
def runs():
    return with_torque(exact_runs(), 0, both)


def test_what_stood_for_two_effects_goes_once_one_of_them_is_in(runs):
    step = step_beside(runs)
    mixture, spring, asymmetric = step.judge([MIXTURE, SPRING, ASYMMETRIC])
    assert mixture.gain > max(spring.gain, asymmetric.gain)
    result = searched(runs, Mixture(), Spring(), AsymmetricFriction())
    assert {item.label(result.scene) for item in result.chosen} == {"spring of joint1", "asymmetric_friction of joint1"}
    assert [item.decision.label for item in result.steps] == [item.label(result.scene) for item in result.chosen]


def test_the_exchange_says_what_it_saves_and_where_to_go_on(runs):
    step = step_beside(runs, [SPRING, MIXTURE])
    found = best_exchange(step, [SPRING, MIXTURE, ASYMMETRIC, Candidate(TimeDelay(), Member(None))], step.scene)
    assert (found.places, found.decision.label) == ((1,), "asymmetric_friction of joint1")
    right = replace(step, chosen=(SPRING, ASYMMETRIC))
    assert found.saved == pytest.approx(float(np.sum(step.model.squares) - np.sum(right.model.squares)), rel=1e-6)
    # The weights are those of a model without either: all but the noise's share of what was left is gone.
    assert best_exchange(right, [SPRING, MIXTURE, ASYMMETRIC], step.scene) is None
    assert best_exchange(step, [SPRING, MIXTURE, ASYMMETRIC], step.scene, ["asymmetric_friction of joint1"]) is None


WHOLE, *SINGLE = (Candidate(TimeDelay(), Member(joint)) for joint in (None, 0, 1))


def late(*delays: float):
    """Return runs whose joints' efforts are so late, s."""
    runs = exact_runs()
    for joint, delay in enumerate(delays):
        runs = [shifted(run, -delay, [joint]) for run in runs]
    return runs


def test_a_delay_of_all_joints_takes_the_place_of_those_of_single_ones_that_agree():
    for chosen in (SINGLE, SINGLE[:1]):
        step = step_beside(late(0.006, 0.006), chosen)
        found = best_exchange(step, [WHOLE, *SINGLE], step.scene)
        assert (found.decision.candidate, found.places) == (WHOLE, tuple(range(len(chosen))))
        # Beside that of a joint it may have been refused, as what the other joint lacks alone.
        found = best_exchange(step, [WHOLE, *SINGLE], step.scene, refused=["time_delay"])
        assert found.decision.candidate == WHOLE
        assert best_exchange(step, [WHOLE, *SINGLE], step.scene, without=["time_delay"]) is None


def test_joints_with_different_delays_keep_them():
    for delays, chosen in (((0.009, 0.004), SINGLE), ((0.006, 0.0), SINGLE[:1])):
        step = step_beside(late(*delays), chosen)
        assert best_exchange(step, [WHOLE, *chosen], step.scene) is None


def test_what_does_as_well_or_comes_nowhere_near_takes_no_place():
    runs = with_torque(exact_runs(size=0.3), 0, lambda motion: STIFFNESS * (motion.q[0] - 1.57))
    bent = Candidate(Bent(), Member(0))
    for chosen, other in ((SPRING, bent), (bent, SPRING)):
        step = step_beside(runs, [chosen])
        assert best_exchange(step, [other, ASYMMETRIC], step.scene) is None
        beside = step.without(0)
        own, rival = beside.judge([chosen, other])
        assert same((beside, own), (beside, rival))
        assert [item.label for item in near_in_place(beside, own, [other, ASYMMETRIC], step.scene)] == [rival.label]


def test_another_place_of_the_same_effect_is_asked_by_the_columns_of_the_model_at_hand(monkeypatch, runs):
    """A clearance of the wrong joint stayed: by the base model's columns that of the right one came nowhere near."""
    step = step_beside(with_torque(exact_runs(), 0, lambda motion: np.exp(-(((motion.q[0] - 1.1) / 0.3) ** 2))))
    grid = [Candidate(Bump(), item) for item in Bump().members(step.scene)]
    (own,) = step.judge([Candidate(Bump(), Member(0, (1.1,)))])
    asked = []
    rows = type(step).rows
    monkeypatch.setattr(
        type(step), "rows", lambda self, scene, items: asked.append((scene, items)) or rows(self, scene, items)
    )
    first = replace(step.scene, value=0.0 * step.scene.value)
    (near,) = near_in_place(step, own, [*grid, SPRING], first)
    assert near.candidate.member.nonlinear == (1.0,)
    assert [items for scene, items in asked if scene is first] == [[SPRING]]


def test_an_effect_that_the_others_make_superfluous_is_dropped(runs):
    """Backwards every effect is judged beside the others; one that nothing was planted for does not stay."""
    extra = Candidate(Stribeck(), Member(0, (0.5,)))
    assert needed(step_beside(runs, (SPRING, extra, ASYMMETRIC))) == (SPRING, ASYMMETRIC)


def test_whether_an_effect_is_needed_is_asked_as_it_is_fitted_with_all_others():
    """A gear loss beside a bent torque sensor was let in, and dropped before both were fitted together."""
    runs = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    runs = with_torque(runs, 0, lambda motion: 0.2 * np.exp(-(((motion.q[0] - 1.15) / 0.3) ** 2)))
    spring = Candidate(Spring(), Member(1))
    coarse = step_beside(runs, (spring, Candidate(Bump(), Member(0, (1.5,)))))
    assert needed(coarse) == (spring,)
    step, dropped = without_superfluous(coarse)
    assert (step.chosen[0], dropped) == (spring, [])
    # The noise moves the bump by less than this.
    assert step.chosen[1].member.nonlinear[0] == pytest.approx(1.15, abs=0.01)


def test_an_effect_that_is_dropped_at_the_end_is_tentative_if_the_model_lacks_it(runs):
    """A clearance that helped in 5 of 7 recordings beside another effect was let in and dropped, and nothing said so."""
    step = step_beside(runs, (SPRING, ASYMMETRIC))
    end, dropped = without_superfluous(step)
    assert (end.chosen, dropped) == ((SPRING, ASYMMETRIC), [])
    # With more votes asked than there are none is accepted: the weakest goes, and the last one stays.
    asked = replace(step, criteria=replace(step.criteria, min_votes=2.0, dominant=2.0))
    end, (gone,) = without_superfluous(asked)
    assert {gone.candidate, *end.chosen} == {SPRING, ASYMMETRIC}
    assert gone.tentative and not gone.accepted
    assert "it helps in only" in gone.why


def test_what_the_others_make_superfluous_is_not_tentative(runs):
    extra = Candidate(Stribeck(), Member(0, (0.5,)))
    end, (gone,) = without_superfluous(step_beside(runs, (SPRING, extra, ASYMMETRIC)))
    assert end.chosen == (SPRING, ASYMMETRIC)
    assert gone.candidate.effect == extra.effect
    assert not (gone.tentative or gone.accepted)


class Shape(Spring):
    """A torque of another shape for each name."""

    def __init__(self, name, shape):
        self.name, self.shape = name, shape

    def __hash__(self):
        return hash(self.name)

    def __eq__(self, other):
        return isinstance(other, Shape) and self.name == other.name

    def signal_columns(self, signals, member):
        return [self.shape(signals.motion)]


def test_what_does_as_well_with_fewer_others_takes_the_place():
    """A spring and a torque read too large were believed to be a counterbalance and four other effects (UR5)."""
    runs = with_torque(exact_runs(), 0, lambda motion: 0.1 * (motion.q[0] - 1.57))
    wrong = Candidate(Shape("wrong", lambda motion: motion.q[0] - 1.57 - 1.5 * np.sin(5.0 * motion.q[0])), Member(0))
    mends = Candidate(Shape("mends", lambda motion: np.sin(5.0 * motion.q[0])), Member(0))
    other = Candidate(Shape("other", lambda motion: np.cos(3.0 * motion.q[1])), Member(1))
    runs = with_torque(runs, 1, lambda motion: 0.05 * np.cos(3.0 * motion.q[1]))
    step = step_beside(runs, [wrong, mends, other])
    beside = step.without(0)
    own, spring = beside.judge([wrong, SPRING])
    assert same((beside, own), (beside, spring))
    assert len(needed(step)) == 3
    found = best_exchange(step, [SPRING], step.scene)
    assert (found.places, found.decision.label) == ((0,), "spring of joint1")
    # Beside two that are both needed with either, it would change nothing.
    assert best_exchange(step_beside(runs, [wrong, mends]), [SPRING], step.scene) is None
