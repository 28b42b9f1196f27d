"""Effects that a run shows and does not settle: listed with what would settle them, and not in the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.checks.noise_check import BY_NOISE
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.diagnosis.selection.tentative import LESS_NOISE, settled_by, tentative_effects
from scara_ident.effects.position import Spring
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, searched, with_torque


@pytest.fixture(scope="module")
def doubtful():
    """A spring that would have to help in more trajectories than there are."""
    runs = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    criteria = replace(CRITERIA, min_votes=1.01)
    return diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),), criteria=criteria)


def test_what_is_not_settled_is_listed_and_not_added(doubtful):
    (spring,) = doubtful.tentative
    assert (spring.effect, spring.joint) == ("spring", "joint2")
    assert "helps in only" in spring.why
    assert spring.settled_by == Spring.experiment
    assert spring.gain > 0.5
    assert not doubtful.effects
    assert doubtful.after.model.names == doubtful.before.model.names


def test_it_stands_in_the_results_as_the_contract_says(doubtful):
    content = diagnosis_dict(doubtful)
    (entry,) = content["tentative"]
    assert {"effect", "joint", "why", "settled_by"} <= set(entry)
    said = f"Worth a look, not added: spring on joint2, would remove {entry['gain']:.0%} of the squared residual; in cross-validation it helps in only"
    assert any(said in sentence for sentence in content["summary"])


def test_what_is_believed_is_not_listed_again(doubtful):
    assert tentative_effects(doubtful.search, (), {("spring", "joint2")}) == ()


@pytest.mark.parametrize("by_noise", [True, False])
def test_what_noise_may_make_is_settled_by_less_of_it(doubtful, by_noise: bool):
    """An elastic joint, of which noise made all, was to be settled by motions that show as much of the noise."""
    (decision,) = (item.decision for item in doubtful.tentative)
    why = f"{BY_NOISE if by_noise else 'chance'} causes it: without that noise 0% of it is left, p = 6.1e-01"
    (spring,) = tentative_effects(doubtful.search, [decision.refused(why)], ())
    assert spring.settled_by == (LESS_NOISE if by_noise else Spring.experiment)


@pytest.mark.parametrize(
    ("size", "step", "said"),
    [
        # Moved well: steps are the limit, or nothing that has any.
        (1.9, 1e-3, "record positions with a finer encoder: the steps are 0.001 rad on joint2"),
        (1.9, 0.0, LESS_NOISE),
        # A finer encoder was asked for here too.
        (0.05, 1e-3, "move joint2 further and faster: it moved by {travel:.2g} rad of {reach:.2g} rad, which is {steps:.2g} encoder steps of 0.001 rad"),
        (0.05, 0.0, "move joint2 further and faster: it moved by {travel:.2g} rad of {reach:.2g} rad, with position noise of "),
    ],
)  # fmt: skip
def test_a_joint_that_hardly_moves_is_to_be_moved_before_its_encoder_is_to_be_finer(
    size: float, step: float, said: str
):
    runs = exact_runs(size=size)
    if step:
        runs = [replace(run, position=step * np.round(run.position / step)) for run in runs]
    search = searched(runs, Spring())
    decision = replace(search.decisions[-1], why=f"{BY_NOISE} makes it")
    assert decision.candidate.member.joint == 1
    travel = max(float(np.ptp(run.position[1])) for run in runs)
    robot = load_robot()
    reach = min(2.0 * np.pi, float(robot.upper[1] - robot.lower[1]))
    found = settled_by(search, [decision])
    assert found.startswith(said.format(travel=travel, reach=reach, steps=travel / 1e-3))
    assert settled_by(search, [replace(decision, why="chance")]) == Spring.experiment
    # Of both joints, one that shows it in other words needs its experiment.
    assert settled_by(search, [decision, replace(decision, why="chance")]) == Spring.experiment
