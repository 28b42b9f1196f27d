import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.errors import UsageError
from scara_ident.estimation.information import Information
from scara_ident.excitation.criteria import BlockLogDet, Condition, LogDet, block_of, criterion_of
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

CRITERIA = (
    LogDet(),
    BlockLogDet((1, 3)),
    Condition(power=6.0),
    Condition(scaled=True, power=6.0),
    Condition((0, 2, 4)),
)


def regressor(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((40, 5)) * np.exp(rng.uniform(-2.0, 2.0, 5))


@given(seed=st.integers(0, 2**31), place=st.integers(0, len(CRITERIA) - 1))
@settings(max_examples=40)
def test_gradients_are_those_of_differences(seed, place):
    criterion = CRITERIA[place]
    h = regressor(seed)
    information = h.T @ h
    _, gradient = criterion.cost(information)
    direction = np.random.default_rng(seed + 1).standard_normal((5, 5))
    size = np.sqrt(np.diag(information))
    direction = (direction + direction.T) * np.outer(size, size)
    step = 1e-4
    slope = sum(
        weight * (criterion.cost(information + k * step * direction)[0])
        for k, weight in ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12))
    )
    expected = np.sum(gradient * direction)
    scale = np.sum(np.abs(gradient * direction))
    assert slope / step == pytest.approx(expected, abs=1e-6 * scale)


def test_log_det_and_condition_are_those_of_the_paper():
    h = regressor(0)
    information = Information.empty(5).absorb(h, np.zeros(40))
    assert LogDet().cost(h.T @ h)[0] == pytest.approx(-information.log_det(), rel=1e-12)
    sharp = Condition(power=400.0).cost(h.T @ h)[0]
    assert sharp == pytest.approx(np.log(information.condition()), abs=0.01)
    assert Condition().cost(h.T @ h)[0] >= np.log(information.condition())


def test_the_block_criterion_is_the_covariance_of_the_block():
    h = regressor(1)
    covariance = np.linalg.inv(h.T @ h)[np.ix_([1, 3], [1, 3])]
    cost, _ = BlockLogDet((1, 3)).cost(h.T @ h)
    assert cost == pytest.approx(np.log(np.linalg.det(covariance)), rel=1e-10)


def test_the_condition_of_scaled_columns_does_not_depend_on_units():
    h = regressor(2)
    units = np.array([1e3, 1.0, 1e-4, 7.0, 0.1])
    scaled = Condition(scaled=True)
    assert scaled.cost((h * units).T @ (h * units))[0] == pytest.approx(scaled.cost(h.T @ h)[0], rel=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_a_lost_rank_costs_infinitely(criterion):
    h = regressor(3)
    h[:, 4] = h[:, 0] + h[:, 2]
    assert criterion.cost(h.T @ h)[0] == np.inf or isinstance(criterion, BlockLogDet)
    h[:, 4] = 0.0
    assert criterion.cost(h.T @ h)[0] == np.inf


def test_blocks_are_named_by_parameters_or_terms():
    model = build_model(load_robot())
    assert block_of(model, ["P_d2", "offset"]).columns == (1, 13, 14)
    with pytest.raises(UsageError, match=r"'P_d9'.*P_d1.*friction"):
        block_of(model, ["P_d9"])
    with pytest.raises(UsageError, match="no parameter"):
        block_of(model, [])


def test_a_criterion_is_named_and_may_be_about_some_parameters():
    model = build_model(load_robot())
    assert criterion_of("logdet", model) == LogDet()
    assert criterion_of("logdet", model, ["P_d2"]) == BlockLogDet((1,))
    assert criterion_of("cond", model) == Condition()
    assert criterion_of("cond", model, ["offset"]) == Condition((13, 14))
    with pytest.raises(UsageError, match="'volume': expected logdet or cond"):
        criterion_of("volume", model)
