"""The motion that tells: within its limits, as sure as promised, and what a random one does not do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.candidates import CandidateColumns
from scara_ident.effects.position import Spring
from scara_ident.effects.tilt import BaseTilt
from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.estimation.observations import observe
from scara_ident.excitation import Effort, design_excitation, excitation_dict, limits_of
from scara_ident.excitation.promise import expected_answers
from scara_ident.excitation.tell import slowed
from scara_ident.identification.usable import usable_in_bands
from scara_ident.inquiry.answerability import inquire, known_rows
from scara_ident.inquiry.questions import Question, questions
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import ReferenceMotion
from tests.diagnosis.made import BANDS
from tests.excitation.designs import hurry
from tests.excitation.made import rigid_model, small_problem
from tests.inquiry.asked import PAIR, open_diagnosis, recorded, small_runs

EFFORT = Effort(starts=1, rounds=0, seed=2, processes=1)


@pytest.fixture(scope="module")
def asked():
    found = open_diagnosis()
    inquiry = inquire(found, questions(found)[:1])
    model = found.before.model
    whole = limits_of(model.robot, share=1.0)
    return inquiry, design_excitation(model, duration=6.0, harmonics=6, tell=inquiry, limits=whole, effort=EFFORT)


@pytest.mark.slow
def test_the_motion_keeps_its_limits_and_is_said_to_tell(asked):
    _, design = asked
    assert all(limit.kept for limit in design.reached)
    content = excitation_dict(design)
    (entry,) = content["tells"]
    assert entry["question"] == PAIR and content["criterion"] == {"name": "tell"}
    assert entry["sigma_before"] < 4.0 and entry["sigma_after"] > 10.0
    assert entry["settled"] is True and entry["unshown"] == []
    # More of the same small motion would not.
    same = expected_answers(asked[0], [part.motion for part in open_diagnosis().search.data.stretches[:1]])
    assert same[0].after < 2.0 * same[0].before + 0.1
    assert not same[0].settled and same[0].instead.startswith(f"This motion does not settle: {PAIR}. To settle it: ")


@pytest.mark.slow
def test_what_was_promised_is_seen_and_the_effect_is_reported(asked):
    inquiry, design = asked
    time = np.linspace(0.0, 6.0, 3001)
    trajectory = design.trajectories[0]
    new = recorded(ReferenceMotion("asked", trajectory.joints, time, *trajectory.at(time)))[:1]
    runs = (*small_runs(), *new)
    model = open_diagnosis().before.model
    data, _, _ = usable_in_bands(model, runs, (), BANDS)
    seen = known_rows(inquiry, CandidateColumns(observe(model, data)))
    (now,) = type(inquiry)(inquiry.scene, inquiry.questions, inquiry.in_model, inquiry.noise, BANDS, seen).sigmas()
    # Ends and rest are left out of the rows, and the low-pass has no sharp edge.
    assert now == pytest.approx(design.tells[0].after, rel=0.15)
    found = diagnose(model.robot, runs, bands=BANDS, catalogue=(Spring(), BaseTilt()))
    (effect,) = found.effects
    assert (effect.effect, effect.joint, effect.confounded_with) == ("spring", "joint1", ())


@pytest.mark.slow
def test_the_motion_tells_as_much_as_that_of_the_largest_log_determinant_of_what_this_is_about():
    found = open_diagnosis()
    model = found.before.model
    # So small that none is ever sure enough.
    each = [Question("parameter", name, parameter=name, size=1e-4) for name in model.names]
    inquiry, whole = inquire(found, each), limits_of(model.robot, share=1.0)
    plain = design_excitation(model, duration=6.0, harmonics=6, limits=whole, effort=EFFORT)
    design = design_excitation(model, duration=6.0, harmonics=6, tell=inquiry, limits=whole, effort=EFFORT)
    of = [[item.after for item in expected_answers(inquiry, [own.motion(rate=200.0)])] for own in (design, plain)]
    assert np.mean(np.log(of[0])) > np.mean(np.log(of[1])) - 0.05


@pytest.mark.slow
def test_a_motion_for_what_may_be_below_the_limit_tells_of_what_nobody_thought_of_too():
    found = open_diagnosis()
    model, (spring, _) = found.before.model, questions(found)[0].suspects
    # So large that any motion tells it.
    large = replace(spring, value=tuple(1e3 * x for x in spring.value))
    inquiry = inquire(found, [Question("below_limit", spring.label, (large,))])
    whole = limits_of(model.robot, share=1.0)
    plain = design_excitation(model, duration=6.0, harmonics=6, limits=whole, effort=EFFORT)
    design = design_excitation(model, duration=6.0, harmonics=6, tell=inquiry, limits=whole, effort=EFFORT)
    assert design.log_det > plain.log_det - 0.1 * len(model.names)


@pytest.mark.slow
def test_the_better_half_of_the_searches_goes_on_whatever_the_number_of_processes(asked, monkeypatch):
    hurry(monkeypatch)
    inquiry, _ = asked
    model, said = inquiry.scene.model, []
    effort = Effort(starts=2, rounds=1, seed=3, processes=1)
    one, two = (
        design_excitation(
            model, duration=6.0, harmonics=4, tell=inquiry, effort=replace(effort, processes=k), progress=said.append
        )
        for k in (1, 2)
    )
    assert [(item.done, item.total) for item in said] == 2 * [(1, 3), (2, 3), (3, 3)]
    assert len(one.costs) == 2 and one.costs == two.costs
    assert np.array_equal(one.trajectories[0].coefficients, two.trajectories[0].coefficients)


def test_a_slow_motion_is_slow_where_the_limit_is_out_of_reach_too():
    robot = load_robot()
    task = small_problem(rigid_model(robot), lengths=((8.0, 6),)).task
    high = limits_of(robot, share=1.0, velocities={"joint1": 1000.0, "joint2": 0.1})
    slow = slowed(replace(task, limits=high), 0.3)
    half = 0.5 * (high.upper - high.lower)[0]
    np.testing.assert_allclose(slow.limits.velocity, [0.3 * 2.0 * np.pi * (6 / 8.0) * half, 0.03])


@pytest.mark.slow
def test_goals_that_exclude_each_other_are_said(asked):
    model = asked[0].scene.model
    with pytest.raises(UsageError, match="takes no criterion"):
        design_excitation(model, tell=asked[0], trajectories=2)
    with pytest.raises(ScaraIdentError, match="left no question"):
        design_excitation(model, tell=inquire(open_diagnosis(), []))
