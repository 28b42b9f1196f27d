"""What a motion promises: as much as its rows and those at hand say, and from which size on effects are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.effects import Member
from scara_ident.effects.periodic import PERIODS_COVERED, TorqueRipple
from scara_ident.estimation.information import merge
from scara_ident.estimation.observations import observe
from scara_ident.excitation.promise import SURE_STANDARD_ERRORS, expected_answers, rows_in_blocks
from scara_ident.identification.usable import usable_in_bands
from scara_ident.inquiry.answerability import inquire, known_rows
from scara_ident.inquiry.questions import Kind, Question, Suspect, questions
from scara_ident.motion.motion import Motion
from tests.diagnosis.made import BANDS, multisine
from tests.inquiry.asked import open_diagnosis, small_runs


def wide_motion(share: float = 1.0) -> Motion:
    """A motion through the workspace at its full speed, or through a share of it."""
    made = multisine("wide", 3, 6.0, share)
    signals = (made.position[:, :-1], made.velocity[:, :-1], made.acceleration[:, :-1])
    return Motion("wide", "wide", made.time[:-1], *signals, None, 1.0 / float(made.time[1]))


def test_recordings_at_hand_count_in_the_bands_that_a_further_one_brings():
    found = open_diagnosis()
    inquiry, motion = replace(inquire(found, questions(found)[:1]), widening=True), wide_motion()
    new, bands = rows_in_blocks(inquiry, motion)
    assert min(bands) > max(BANDS)
    data, _, _ = usable_in_bands(inquiry.scene.model, small_runs(), (), bands)
    again = known_rows(inquiry, CandidateColumns(observe(inquiry.scene.model, data)))
    (item,) = expected_answers(inquiry, [motion])
    assert item.after == pytest.approx(inquiry.sigmas(merge([again, new.information]))[0], rel=1e-6)
    assert item.before == inquiry.sigmas()[0]


def test_of_what_may_be_below_the_limit_that_which_would_not_be_found_is_named():
    found, motion = open_diagnosis(), wide_motion()
    first, second = questions(found)[0].suspects
    faint = replace(second, value=tuple(1e-3 * x for x in second.value))
    each = [Question("below_limit", item.label, (item,), experiment="weigh it") for item in (first, faint)]
    spring, tilt = expected_answers(inquire(found, each), [motion])
    assert spring.settled and spring.unshown == () and spring.instead == ""
    assert not tilt.settled and tilt.unshown == ("base_tilt",)
    assert tilt.instead == "This motion does not settle: base_tilt. To settle it: weigh it."
    # Of several, what brings out those that it does not tell.
    both = Question("below_limit", "all", (first, faint), experiment="weigh it")
    (item,) = expected_answers(inquire(found, [both]), [motion])
    assert item.unshown == ("base_tilt",)
    assert item.instead == f"This motion does not settle: base_tilt. To settle it: {faint.candidate.effect.experiment}."


def test_the_least_that_would_be_found_is_as_large_as_needed():
    found, motion = open_diagnosis(), wide_motion()
    spring = questions(found)[0].suspects[0]

    def shown(value: tuple[float, ...]):
        asked = [Question("below_limit", "spring", (replace(spring, value=value),))]
        # What the model has is asked for at the size that it has there.
        inquiry = inquire(found, asked)
        (item,) = expected_answers(
            replace(inquiry, in_model=(), known=known_rows(replace(inquiry, in_model=()), inquiry.columns)), [motion]
        )
        return item, item.shown[0]

    item, own = shown(spring.value)
    (name, limit), *_ = own.limit.items()
    assert (name, limit.unit) == ("stiffness", "N m/rad")
    assert own.times > 1.0 and limit.value == pytest.approx(abs(spring.value[0]) / own.times)
    assert item.entry()["detection_limit"] == {"spring of joint1": {"stiffness": limit.value}}
    assert f"Smallest sizes that would be found: spring of joint1, stiffness {limit.value:.2g} N m/rad." in item.words
    assert shown((limit.value,))[1].times == pytest.approx(1.0)
    smaller, _ = shown((0.9 * limit.value,))
    assert smaller.unshown == ("spring of joint1",) and not smaller.settled


class Slow(TorqueRipple):
    """A ripple with few periods in a motion of the joint."""

    name = "slow"
    orders = (0.1,)


@pytest.mark.parametrize("kind", ["confounders", "below_limit"])
def test_of_what_the_motion_holds_too_few_periods_to_be_tried_is_named(kind: Kind):
    found, small, wide = open_diagnosis(), wide_motion(0.1), wide_motion()
    ripple = Suspect(Candidate(Slow(), Member(0, Slow.orders)), "ripple of joint1", (0.05, 0.0))
    asked = Question(kind, "spring or ripple", (questions(found)[0].suspects[0], ripple))
    inquiry = inquire(found, [asked])
    per_turn = abs(float(inquiry.scene.robot.reduction[0])) * Slow.orders[0] / (2.0 * np.pi)
    reach = max(float(inquiry.scene.travel[0]), float(np.ptp(small.q[0])))
    assert per_turn * reach < PERIODS_COVERED < per_turn * np.ptp(wide.q[0])
    (near,), (far,) = expected_answers(inquiry, [small]), expected_answers(inquiry, [wide])
    assert near.unshown == ("ripple of joint1",) and not near.settled
    assert near.instead == f"This motion does not settle: ripple of joint1. To settle it: {Slow.experiment}."
    assert far.unshown == () and far.settled == (kind == "below_limit" or far.after >= SURE_STANDARD_ERRORS)
