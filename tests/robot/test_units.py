"""Units of channels by their definitions."""

from __future__ import annotations

import math

import pytest

from scara_ident.robot.units import COUNT, find_unit, table_of

SIGNALS = ("time", "position", "velocity", "acceleration", "effort", "temperature")


@pytest.mark.parametrize(
    ("signal", "linear", "number", "unit", "si"),
    [
        ("time", False, 1500.0, "ms", 1.5),
        ("time", True, 2e9, "ns", 2.0),
        ("position", False, 180.0, "deg", math.pi),
        ("position", False, 0.5, "turn", math.pi),
        ("position", True, 250.0, "um", 250e-6),
        ("velocity", False, 60.0, "rpm", 2 * math.pi),
        ("velocity", False, 90.0, "deg/s", math.pi / 2),
        ("velocity", True, 30.0, "mm/s", 0.03),
        ("acceleration", False, 0.25, "turn/s^2", math.pi / 2),
        ("effort", False, 150.0, "N cm", 1.5),
        ("effort", True, 2.0, "kN", 2000.0),
        ("effort", True, 40.0, "permille", 0.04),
        ("temperature", False, 300.0, "K", 26.85),
    ],
)
def test_a_number_in_a_unit_is_this_much_in_si(signal: str, linear: bool, number: float, unit: str, si: float):
    found = table_of(signal, linear=linear)[unit]
    assert found.factor * number + found.offset == pytest.approx(si, rel=1e-14)


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("signal", SIGNALS)
def test_the_first_unit_is_that_of_si_and_every_unit_is_found_by_its_name(signal: str, linear: bool):
    table = table_of(signal, linear=linear)
    first = next(iter(table.values()))
    assert (first.factor, first.offset) == (1.0, 0.0)
    assert all(find_unit(name, table) is unit for name, unit in table.items())


def test_rates_are_the_units_of_position_over_seconds():
    for linear in (False, True):
        for unit in table_of("position", linear=linear).values():
            for signal, ending in (("velocity", "s"), ("acceleration", "s^2")):
                assert table_of(signal, linear=linear)[f"{unit.name}/{ending}"].factor == unit.factor
    assert table_of("position", linear=False)[COUNT].factor == 2 * math.pi


def test_what_a_drive_reports_is_a_torque_only_with_a_gain():
    for linear in (False, True):
        needing = {unit.name for unit in table_of("effort", linear=linear).values() if unit.needs_gain}
        assert needing == {"A", "mA", "%", "permille"}


@pytest.mark.parametrize(
    ("word", "signal", "name"),
    [("Nm", "effort", "N m"), (" mN  m", "effort", "mN m"), ("µs", "time", "us"), ("μs", "time", "us"), ("rad/s²", "acceleration", "rad/s^2")],
)  # fmt: skip
def test_blanks_and_signs_are_written_in_many_ways(word: str, signal: str, name: str):
    found = find_unit(word, table_of(signal, linear=False))
    assert found is not None
    assert found.name == name


@pytest.mark.parametrize("word", ["", "degrees", "RAD", "m"])
def test_another_word_is_no_unit(word: str):
    assert find_unit(word, table_of("position", linear=False)) is None
