"""Names and texts that stand for effects."""

from __future__ import annotations

import pytest

from scara_ident.errors import UsageError
from scara_ident.simulation import (
    CATALOGUE,
    Effect,
    parse_effect,
)
from scara_ident.simulation import effects as fx
from tests.shared import shared_path


def test_names_are_the_contracts() -> None:
    text = shared_path("interface.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip().strip("`") for line in text.splitlines() if line.startswith("| `")]
    table = text[text.index("| `effect` | `parameters` |") :]
    named = {line.split("|")[1].strip().strip("`") for line in table.splitlines()[2:] if line.startswith("| `")}
    assert rows
    assert {kind.name for kind in CATALOGUE} == named


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("spring", fx.Spring()),
        ("spring:joint2", fx.Spring("joint2")),
        ("spring:joint2:stiffness=0.05", fx.Spring("joint2", stiffness=0.05)),
        ("time_delay:delay=0.002", fx.TimeDelay(delay=0.002)),
        ("push:from=4.2,direction=0/0/-1", fx.Push(time=4.2, direction=(0.0, 0.0, -1.0))),
        ("spring:joint2:recording=OJD_2", fx.Spring("joint2")),
        ("torque_ripple:joint1:order=4,amplitude=0.05,sensor=true", fx.TorqueRipple("joint1", 4.0, 0.05, sensor=True)),
    ],
)
def test_text_stands_for_an_effect(text: str, expected: Effect) -> None:
    assert repr(parse_effect(text)) == repr(expected)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sprang", "did you mean spring"),
        ("", "there are transmission_loss"),
        ("spring:joint1:stiffness=much", "expected a number"),
        ("spring:joint1:joint2", "expected NAME:JOINT"),
        ("spring:stiffness=1,stiffness=2", "given twice"),
        ("torque_ripple:sensor=3", "expected true or false"),
        ("push:direction=1/0", "expected 3 numbers as in 0/0/1"),
        ("push:direction=up", "expected 3 numbers"),
        ("push:force=1/2", "expected a number"),
        ("push:time=3", "it has force, from, duration, direction, link, point, edge, recording"),
        ("spring:joint1:size=3", "it has stiffness, rest_position, recording"),
        ("spring:joint=joint2,stiffness=1", "name the joint before the values: spring:joint2:KEY=VALUE"),
    ],
)
def test_text_that_stands_for_none_is_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        parse_effect(text)
    assert "\n" not in str(caught.value)
