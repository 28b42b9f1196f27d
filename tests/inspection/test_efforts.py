"""Of a torque, a current and a computed torque in one log one is taken, and the reason is said."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.efforts import SAME_SIGNAL, is_computed, is_torque
from scara_ident.inspection.names import meaning
from tests.inspection.made import MADE, inspected
from tests.made_recordings import save

# N m per A.
CONSTANT = 0.35


def taken_of(folder, columns):
    """Return what is taken of a log with these efforts, and the notes that say what was not."""
    made = {name: values for name, values in MADE.items() if not name.endswith("effort")}
    for number, joint in enumerate(("joint1", "joint2"), start=1):
        made |= {f"{name}{number}": of(MADE[f"{joint}.effort"]) for name, of in columns.items()}
    found = inspected(save(folder / "a.parquet", made), folder)
    return found.mapping["effort"], [note for note in found.notes if "taken, not" in note]


def same(torque):
    return torque


def current(torque):
    """A measured current, in steps of 10 mA."""
    return np.round(torque / CONSTANT, 2)


def of_friction(torque):
    """A current that has in it what a controller's model lacks."""
    return torque / CONSTANT + 0.3 * np.std(torque / CONSTANT) * np.sign(np.diff(torque, append=torque[-1]))


@pytest.mark.parametrize("name", ["Current", "TorqueCur"])
def test_a_torque_that_is_no_multiple_of_a_current_may_be_computed(tmp_path, name):
    for columns in ({"Torque": same, name: of_friction}, {name: of_friction, "Torque": same}):
        mapping, (note,) = taken_of(tmp_path, columns)
        assert mapping == {"column": "Torque{number}", "unit": "N m"}
        assert note.endswith(
            "a torque needs no effort_gain, but is no measurement if the controller computes it from a model; "
            f"then state {name}{{number}} under recording: effort"
        )


def test_a_torque_that_is_a_multiple_of_the_current_is_the_same_measurement(tmp_path):
    mapping, (note,) = taken_of(tmp_path, {"Torque": same, "Current": current})
    assert mapping["unit"] == "N m"
    assert note.endswith("a torque needs no effort_gain, and here it is a multiple of Current{number}")


def test_what_its_name_calls_computed_is_not_taken_where_a_current_is_measured(tmp_path):
    mapping, (note,) = taken_of(tmp_path, {"tau_model_": same, "current_": of_friction})
    assert mapping == {"column": "current_{number}", "unit": "A"}
    assert note.endswith("tau_model_{number} is computed and not measured, by its name")


def test_a_current_that_its_name_calls_measured_is_taken(tmp_path):
    mapping, (note,) = taken_of(tmp_path, {"Torque": same, "ActualCurrent": of_friction})
    assert mapping["unit"] == "A"
    assert note.endswith("ActualCurrent{number} is measured, by its name")


def test_a_computed_torque_alone_is_said_to_be_one(tmp_path):
    made = {name.replace("effort", "tau_ff"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert any(note.endswith("seems to be computed, not a measurement, by its name") for note in found.notes)


def test_of_two_torques_nothing_is_said_of_currents(tmp_path):
    _, (note,) = taken_of(tmp_path, {"Torque": same, "trq": current})
    assert note == "effort: Torque{number} taken, not trq{number}"


def test_names_tell_torques_and_what_is_computed():
    assert is_torque(meaning("Torque1")) and is_torque(meaning("TorqueCur1 [Nm]"))
    assert not any(is_torque(meaning(name)) for name in ("TorqueCur1", "current1", "effort1", "Torque1 [%]"))
    assert is_computed(meaning("tau_ff_1")) and not is_computed(meaning("tau_1"))
    assert not is_computed(meaning("model_position_1"))


def test_a_multiple_has_an_offset_and_its_rounding(tmp_path):
    for share, said in ((0.5 * SAME_SIGNAL, "is a multiple"), (2.0 * SAME_SIGNAL, "computes it")):

        def noisy(torque, share=share):
            noise = np.random.default_rng(0).standard_normal(len(torque)) * np.std(torque)
            return (torque + share * noise) / CONSTANT + 1.0

        assert said in taken_of(tmp_path, {"Torque": same, "Current": noisy})[1][0]
