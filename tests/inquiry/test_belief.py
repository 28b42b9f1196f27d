"""What the diagnosis would let in: foreseen from products in blocks, and what it then does on draws of noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.diagnosis.testing.candidate_tests import examine, gains
from scara_ident.diagnosis.testing.fitted_model import FittedModel
from scara_ident.effects import Member
from scara_ident.effects.measurement import SAMPLING, TimeDelay
from scara_ident.estimation.information import Information
from scara_ident.inquiry.answerability import inquire
from scara_ident.inquiry.belief import Blocks, believed, known_blocks, times_apart, times_believed
from scara_ident.inquiry.questions import Question, Suspect, questions
from tests.diagnosis.made import BANDS
from tests.inquiry.asked import open_diagnosis

ROWS, BLOCKS, PARAMETERS, TRIED = 12, 40, 4, 100


def blocks_of(*extra: np.ndarray) -> Blocks:
    """Two trajectories, the second three times as long, of a model of a few columns and some more."""
    rng = np.random.default_rng(5)
    columns = np.vstack([rng.standard_normal((PARAMETERS, ROWS * BLOCKS)), *extra])
    trajectory = (np.arange(BLOCKS) >= BLOCKS // 4).astype(np.intp)
    return Blocks((columns,), (np.arange(0, ROWS * BLOCKS + 1, ROWS),), trajectory, trajectory)


def column(where: list[int]) -> np.ndarray:
    """A column of unit length in some of the blocks, as large in each."""
    rng = np.random.default_rng(6)
    found = np.zeros((BLOCKS, ROWS))
    found[where] = rng.standard_normal((len(where), ROWS))
    return (found / np.linalg.norm(found)).reshape(1, -1)


def mostly_one() -> np.ndarray:
    """A column of unit length in all blocks, with most of its square in one."""
    found = column(SPREAD).reshape(BLOCKS, ROWS)
    found[7] *= 15.0
    return (found / np.linalg.norm(found)).reshape(1, -1)


def let_in(model: FittedModel, own: np.ndarray, size: float, draws: int = 100) -> float:
    rng = np.random.default_rng(7)
    (rows,) = model.joints
    count = 0
    for _ in range(draws):
        torque = size * own[0] + rng.standard_normal(own.shape[1])
        joint = type(rows)(rows.columns, np.vstack([rows.table[:-1], torque]), rows.starts, rows.counts)
        now = FittedModel((joint,), model.parameters, model.owner, model.fold, model.weights)
        (found,) = examine(now, [{0: own}])
        (gain,) = gains(now, [{0: own}], [0], [found])
        helps, voting = found.votes
        sure = found.p_value * TRIED <= CRITERIA.family_error and gain >= CRITERIA.min_gain
        count += sure and helps >= CRITERIA.min_votes * voting
    return count / draws


SPREAD, SHORT = list(range(BLOCKS)), [2, 7, 15, 22, 30]


@pytest.mark.slow
@pytest.mark.parametrize("own", [column(SPREAD), column(SHORT), mostly_one()])
def test_much_less_than_is_needed_is_seldom_let_in_and_much_more_nearly_always(own):
    model = blocks_of(own).fitted(range(PARAMETERS), CRITERIA.parts)
    needed = 1.0 / times_believed(model, [{0: own}], [np.ones((1, 1))], [ROWS * BLOCKS], TRIED)[0]
    # Of few blocks the standard error itself is hardly known, to a third or so with four degrees of freedom.
    assert let_in(model, own, 0.3 * needed) <= 0.1
    assert 0.2 < let_in(model, own, needed) < 0.8
    assert let_in(model, own, 2.5 * needed) > 0.9


def test_what_lives_in_few_blocks_is_believed_less_at_as_many_standard_errors():
    spread, short = column(SPREAD), column(SHORT)
    model = blocks_of(spread, short).fitted(range(PARAMETERS), CRITERIA.parts)
    axes = [np.full((1, 1), 10.0)] * 3
    one, other, none = times_believed(model, [{0: spread}, {0: short}, {}], axes, [ROWS * BLOCKS] * 3, TRIED)
    assert one > 1.0 > other > none == 0.0


def test_without_the_test_as_few_standard_errors_are_needed_as_with_all_freedom():
    columns = [column(SPREAD), column(SHORT)]
    model, axes = blocks_of(*columns).fitted(range(PARAMETERS), CRITERIA.parts), [np.full((1, 1), 10.0)] * 2
    counts = [ROWS * BLOCKS] * 2
    whole, free = (
        times_believed(model, [{0: own} for own in columns], axes, counts, TRIED, tested=tested)
        for tested in (True, False)
    )
    assert np.all(free >= whole) and free[1] > 1.2 * whole[1]
    # What blocks spread evenly says is hardly less than what all freedom says.
    assert free[0] < 1.2 * whole[0]


def test_in_short_are_all_products_of_folds_and_what_follows_from_them():
    columns = [column(SPREAD), column(SHORT)]
    two = blocks_of(*columns)
    one = replace(two, trajectory=np.zeros(BLOCKS, dtype=np.intp))
    axes, counts = [np.full((1, 1), 10.0)] * 2, [ROWS * BLOCKS] * 2
    for blocks, parts in ((two, 1), (one, CRITERIA.parts), (two.with_more(one), 1)):
        short = blocks.in_short(parts)
        assert short.counts == pytest.approx(blocks.counts) and short.tables[0].shape[1] < 0.1 * blocks.counts[0]
        assert short.information.factor.T @ short.information.factor == pytest.approx(
            blocks.information.factor.T @ blocks.information.factor, abs=1e-9
        )
        found = []
        for some in (blocks, short):
            model = some.fitted(range(PARAMETERS), CRITERIA.parts)
            own = [some.rows(slice(PARAMETERS + k, PARAMETERS + k + 1)) for k in range(2)]
            found.append(times_believed(model, own, axes, counts, TRIED, tested=False))
        assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_blocks_taken_together_hold_the_same_rows_and_more_are_of_other_trajectories():
    some = blocks_of()
    both = some.with_more(some)
    assert both.tables[0].shape == (PARAMETERS, 2 * ROWS * BLOCKS)
    assert both.starts[0][-1] == 2 * ROWS * BLOCKS and len(both.starts[0]) == 2 * BLOCKS + 1
    assert both.trajectory.max() == 3 and len(both.owner) == 2 * BLOCKS
    many = both
    for _ in range(2):
        many = many.with_more(many)
    fewer = many.fewer()
    assert len(fewer.owner) < len(many.owner) and set(fewer.owner) == set(many.owner)
    products = many.fitted(range(PARAMETERS), CRITERIA.parts), fewer.fitted(range(PARAMETERS), CRITERIA.parts)
    assert products[0].joints[0].table == pytest.approx(products[1].joints[0].table)
    assert np.sum(products[1].basis_products, axis=0) == pytest.approx(np.eye(PARAMETERS), abs=1e-9)


def test_what_another_effect_does_nearly_as_well_is_not_distinguished_from_it():
    found = open_diagnosis()
    suspects = questions(found)[0].suspects
    asked = [Question("below_limit", item.label, (item,)) for item in suspects]
    inquiry = replace(inquire(found, asked), in_model=(), known=None)
    p, width = len(inquiry.scene.model.columns), [len(item.value) for item in suspects]
    rows = np.random.default_rng(8).normal(size=(90, p + sum(width)))
    model, spring, tilt = np.split(rows, [p, p + width[0]], axis=1)

    def apart(rows: np.ndarray) -> float:
        return times_apart(inquiry, suspects, Information.empty(rows.shape[1]).absorb(rows, np.zeros(90)))[
            "spring of joint1"
        ]

    # One that the tilt's first column does but for a little, and one as far from it as columns of noise are.
    near = 40.0 * tilt[:, :1] + 30.0 * spring
    torque = near @ np.array(suspects[0].value)
    left = [np.sum((torque - a @ np.linalg.lstsq(a, torque)[0]) ** 2) for a in (model, np.hstack([model, tilt]))]
    assert left[1] < 0.5 * left[0]
    expected = max(left[1] / (2.0 * CRITERIA.alike) ** 2, left[1] / ((1.0 - CRITERIA.min_share) * left[0]))
    assert apart(np.hstack([model, near, tilt])) == pytest.approx(np.sqrt(expected), rel=1e-9)
    assert apart(np.hstack([model, 40.0 * tilt[:, :1], tilt])) == pytest.approx(0.0, abs=1e-6)


def test_what_is_too_small_to_speak_of_is_not_promised_however_sure():
    found = open_diagnosis()
    delay = Suspect(Candidate(TimeDelay(), Member(0)), "time_delay of joint1", (0.02,))
    inquiry = inquire(found, [Question("below_limit", "delay", (delay,))])
    # Recordings without noise to speak of would show a thousandth of a sample.
    blocks = known_blocks(replace(inquiry, noise=1e-12 * inquiry.noise), BANDS)
    (times,) = believed(inquiry, blocks).values()
    assert times == pytest.approx(0.02 * inquiry.scene.rate / SAMPLING, rel=0.02)
