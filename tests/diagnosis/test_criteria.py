"""Numbers behind decisions: each says its unit and why, and is obeyed where it is given."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import scara_ident
from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.lines import line_candidates
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.testing.screening import screen
from scara_ident.effects.periodic import TorqueRipple, Vibration
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, complete, exact_runs, residuals_of, step_beside, with_torque

PACKAGE = Path(scara_ident.__file__).parent
DECIDING = (
    "testing/acceptance", "testing/candidate_tests", "selection/search", "selection/confounding", "evidence/outcome",
    "model_selection", "proxies",
)  # fmt: skip
# How many columns are worked on at once, and rounding.
NUMERICS = {"_COLUMNS", "_RANK"}


def syntax(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def numbers(node: ast.AST) -> Iterator[ast.Constant]:
    for item in ast.walk(node):
        if isinstance(item, ast.Constant) and type(item.value) in (int, float):
            yield item


def test_every_number_has_a_unit_a_reason_and_a_source():
    documented = CRITERIA.documented()
    assert [row[0] for row in documented] == [item.name for item in fields(SelectionCriteria)]
    for name, value, unit, reason, source in documented:
        assert value == getattr(CRITERIA, name)
        assert unit, name
        assert len(reason.split()) >= 2, name
        assert source, name
        assert np.all(np.asarray(value) > 0.0), name


def test_what_they_stand_behind_keeps_its_order():
    assert CRITERIA.absorbed < CRITERIA.min_outside
    assert CRITERIA.min_gain < CRITERIA.remainder
    assert CRITERIA.wider > 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "verdict", "found"),
    [
        ({}, "explained", ["spring"]),
        # With a bar that nothing clears the remainder stays.
        ({"min_gain": 1.01}, "unexplained", []),
        ({"max_effects": 0}, "unexplained", []),
        # Where so much may be left over, nothing is; but where nothing could have come in, that nothing did says nothing.
        ({"min_gain": 1.01, "remainder": 1.01, "remainder_to_noise": 1e3, "min_remainder": 1.0}, "undecided", []),
        (
            {
                "min_gain": 1.01,
                "remainder": 1.01,
                "remainder_to_noise": 1e3,
                "min_remainder": 1.0,
                "min_power": 2.0,
                # However little of it is white, or changes within recordings.
                "min_colour": 1.0,
            },
            "complete",
            [],
        ),
    ],
)
def test_a_diagnosis_obeys_the_criteria_that_it_is_given(change: dict, verdict: str, found: list[str]):
    runs = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    criteria = replace(CRITERIA, **change)
    result = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),), criteria=criteria)
    assert (result.verdict, [effect.effect for effect in result.effects]) == (verdict, found)


def spring_diagnosed(criteria: SelectionCriteria):
    runs = with_torque(exact_runs(), 1, lambda motion: 0.05 * motion.q[1])
    return diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),), criteria=criteria)


def test_what_comes_after_the_most_effects_is_named_and_nothing_is_then_called_explained():
    """On six joints with Stribeck friction each the search ended after six, and was `explained` with a spring left over."""
    runs = exact_runs()
    for joint in (0, 1):
        runs = with_torque(runs, joint, lambda motion, joint=joint: 0.05 * motion.q[joint])
    few = replace(CRITERIA, max_effects=0)
    result = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),), criteria=few)
    assert result.verdict != "explained" and result.verdict != "complete"
    left = [item for item in result.tentative if item.effect == "spring"]
    assert left and all("no more are believed at once" in item.why for item in left)
    assert not any(decision.accepted for decision in result.search.decisions)


@pytest.mark.slow
def test_a_limit_doubled_or_halved_lets_an_effect_out_or_in():
    (spring,) = spring_diagnosed(CRITERIA).effects
    below = replace(CRITERIA, min_gain=spring.gain / 1.5)
    assert spring_diagnosed(below).effects
    above = replace(below, min_gain=2.0 * below.min_gain)
    assert not spring_diagnosed(above).effects
    assert spring_diagnosed(replace(above, min_gain=0.5 * above.min_gain)).effects


@pytest.mark.slow
def test_what_may_be_left_over_is_obeyed():
    none = replace(CRITERIA, min_gain=1.01, min_power=2.0)
    share = spring_diagnosed(none).dependences[0].explained
    lenient = replace(none, remainder=min(1.5 * share, 1.01), remainder_to_noise=1e3)
    # What may be left over is nothing in particular, and what surely repeats no noise either.
    assert spring_diagnosed(lenient).verdict == "undecided"
    assert spring_diagnosed(replace(lenient, min_remainder=1.0, min_colour=1.0)).verdict == "complete"
    assert spring_diagnosed(replace(lenient, remainder=0.5 * lenient.remainder)).verdict == "unexplained"


def lines_of(added, criteria: SelectionCriteria) -> set[str]:
    bands = (40.0, 40.0)
    scene = step_beside(exact_runs(), bands=bands).scene
    residuals = residuals_of(scene.value, with_torque(exact_runs(), 1, added), bands)
    found = line_candidates(scene, residuals, (TorqueRipple(), Vibration()), criteria)
    return {item.effect.name for item in found}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("added", "name", "change"),
    [
        # An order of 1.37.
        (lambda motion: 0.01 * np.sin(137.0 * motion.q[1]), "torque_ripple", {"highest_order": 1.0}),
        (lambda motion: 0.01 * np.sin(137.0 * motion.q[1]), "torque_ripple", {"lowest_order": 2.0}),
        # 3 Hz are 36 periods in 12 s.
        (lambda motion: 0.02 * np.sin(6.0 * np.pi * motion.time), "vibration", {"min_line_periods": 60.0}),
        (lambda motion: 0.02 * np.sin(6.0 * np.pi * motion.time), "vibration", {"line_significance": 1e-300}),
    ],
)
def test_lines_are_looked_for_where_the_criteria_say(added, name: str, change: dict):
    assert name in lines_of(added, CRITERIA)
    assert name not in lines_of(added, replace(CRITERIA, **change))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", ["single_bins", "pair_bins", "shrinkage", "parts"])
def test_what_signals_explain_follows_bins_shrinkage_and_parts(name: str, factor: float):
    runs = exact_runs(1, 4)
    residuals = residuals_of(step_beside(runs).scene.value, with_torque(runs, 1, lambda m: 0.02 * np.sin(6.0 * m.q[1])))
    value = getattr(CRITERIA, name)
    criteria = replace(CRITERIA, min_per_bin=1)
    changed = replace(criteria, **{name: type(value)(factor * value)})
    found, other = screen(complete(), residuals, criteria), screen(complete(), residuals, changed)
    assert {item.signals for item in found} == {item.signals for item in other}
    assert [item.explained for item in found] != [item.explained for item in other]


def test_a_signal_says_nothing_with_too_few_samples_in_a_bin():
    residuals = residuals_of(step_beside(exact_runs()).scene.value, exact_runs())
    assert screen(complete(), residuals)
    assert screen(complete(), residuals, replace(CRITERIA, min_per_bin=1000)) == ()


def test_every_criterion_is_read_somewhere():
    read = {
        node.attr
        for path in (PACKAGE / "diagnosis").rglob("*.py")
        if path.stem != "criteria"
        for node in ast.walk(syntax(path))
        if isinstance(node, ast.Attribute)
    }
    assert {item.name for item in fields(SelectionCriteria)} <= read


@pytest.mark.parametrize("name", DECIDING)
def test_no_other_number_decides(name: str):
    for statement in syntax(PACKAGE / "diagnosis" / f"{name}.py").body:
        if isinstance(statement, ast.Assign) and {item.id for item in statement.targets} <= NUMERICS:
            continue
        # Halves, ones and twos are of formulas; axes go up to three.
        assert {item.value for item in numbers(statement)} <= {0, 0.5, 1, 2, 3}, ast.unparse(statement)


@pytest.mark.parametrize("room", ["diagnosis", "inquiry", "effects"])
def test_every_constant_says_what_it_is_for(room: str):
    for path in sorted((PACKAGE / room).rglob("*.py")):
        lines = path.read_text(encoding="utf-8").splitlines()
        for statement in syntax(path).body:
            if not isinstance(statement, ast.Assign) or any(isinstance(x, ast.Call) for x in ast.walk(statement)):
                continue
            if any(numbers(statement.value)):
                assert lines[statement.lineno - 2].startswith("# "), f"{path.name}: {lines[statement.lineno - 1]}"
