"""An arm that is unlike the others from its first date on is named, and of a fleet without one none is."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.fleet.odd import FALSE_ODD_LEVEL, FEWEST_ARMS, odd_arms
from scara_ident.fleet.table import Quantity
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

MODEL = build_model(load_robot())
# Parameters of a healthy arm, and how much they differ from arm to arm and by noise.
MIDDLE, SPREAD, NOISE = 1.0, 0.1, 0.02


def fleet(random, arms=8, *, shift=None, std=None):
    """Quantities of the first date of some arms, of which those of the first one are shifted, by parameter in spreads."""
    found = {}
    for k in range(arms):
        each = []
        for column in MODEL.columns:
            own = (std or {}).get(column.name, NOISE) if k == 0 else NOISE
            value = MIDDLE + SPREAD * random.standard_normal() + own * random.standard_normal()
            value += SPREAD * (shift or {}).get(column.name, 0.0) * (k == 0)
            each.append(Quantity(column.name, column.joint, column.unit, float(value), own))
        found[f"arm{k}"] = each
    return found


def test_an_odd_arm_is_named_with_its_parameter_and_how_far_it_is():
    """An arm whose parameters were far from those of all others on every date was unchanged, and nothing else was said."""
    shift = {"a02": 40.0, "P_d1": -60.0}
    found = odd_arms(MODEL, fleet(np.random.default_rng(1), shift=shift))
    assert list(found) == ["arm0"]
    assert {item.name for item in found["arm0"]} == set(shift)
    first, second = found["arm0"]
    assert abs(first.stds) > abs(second.stds) > 10.0
    named = {item.name: item for item in found["arm0"]}
    assert named["P_d1"].stds < 0.0 < named["a02"].stds
    assert named["a02"].words == (
        f"a02 (Coulomb friction of joint2) is {named['a02'].value:.3g} N m, {named['a02'].stds:.0f} standard deviations "
        f"above the median of 8 arms, {named['a02'].middle:.3g}"
    )


def test_a_quarter_of_the_arms_may_be_odd():
    first = fleet(np.random.default_rng(2), shift={"a01": 200.0})
    second = fleet(np.random.default_rng(3), shift={"a01": 230.0})
    assert set(odd_arms(MODEL, first | {"arm1": second["arm0"]})) == {"arm0", "arm1"}


def test_of_few_arms_nothing_is_said():
    random = np.random.default_rng(4)
    assert odd_arms(MODEL, fleet(random, FEWEST_ARMS - 1, shift={"a02": 1e6})) == {}
    assert set(odd_arms(MODEL, fleet(random, FEWEST_ARMS, shift={"a02": 1e6}))) == {"arm0"}
    assert odd_arms(MODEL, {}) == {}


def test_what_is_uncertain_or_not_determined_is_not_odd():
    shift = {"a02": 60.0}
    uncertain = fleet(np.random.default_rng(5), shift=shift, std={"a02": 60.0 * SPREAD})
    assert "arm0" not in odd_arms(MODEL, uncertain)
    unknown = fleet(np.random.default_rng(5), shift=shift, std={"a02": np.inf})
    assert "arm0" not in odd_arms(MODEL, unknown)


def test_arms_that_are_alike_but_for_noise_are_not_odd():
    """Where most arms had the same value the spread between them was none, and rounding was far off."""
    quantities = fleet(np.random.default_rng(6))
    alike = {
        arm: [Quantity(q.name, q.joint, q.unit, 1.0 + 1e-9 * (arm == "arm0"), NOISE) for q in each]
        for arm, each in quantities.items()
    }
    assert odd_arms(MODEL, alike) == {}
    exact = {arm: [Quantity(q.name, q.joint, q.unit, 1.0, 0.0) for q in each] for arm, each in alike.items()}
    assert odd_arms(MODEL, exact) == {}


@pytest.mark.parametrize("arms", [5, 8, 20])
def test_of_fleets_without_an_odd_arm_as_many_name_one_as_stated(arms):
    """Of 500 fleets ten are stated: 22 or more would be by chance in one of 1600 tests (binomial)."""
    random = np.random.default_rng(arms)
    named = sum(bool(odd_arms(MODEL, fleet(random, arms))) for _ in range(500))
    assert named < 22 and FALSE_ODD_LEVEL == 0.02
