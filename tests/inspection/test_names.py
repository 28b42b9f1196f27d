"""What the name of a column says."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.names import meaning, meanings_by_place
from tests.inspection.made import MADE
from tests.recording.files.formats import JOINTS

UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint")


@pytest.mark.parametrize(
    ("name", "quantity", "joint", "number", "unit"),
    [
        ("shoulder_pan_joint.position", "position", 0, None, None),
        ("/joint_states/wrist_1_joint/velocity", "velocity", 3, None, None),
        ("elbow.pos [deg]", "position", 2, None, "deg"),
        ("elbow_current_mA", "effort", 2, None, "mA"),
        ("wrist_1_vel_rpm", "velocity", 3, None, "rpm"),
        ("ShoulderLiftTorque", "effort", 1, None, None),
        ("actual_q_0", "position", None, 0, None),
        ("log.qd[3]", "velocity", None, 3, None),
        ("tau_3 (Nm)", "effort", None, 3, "N m"),
        ("joint_2_temperature", "temperature", None, 2, None),
        ("I[2]", "effort", None, 2, None),
        ("I", None, None, None, None),
        ("t_ms", "time", None, None, "ms"),
        ("__time", "time", None, None, None),
        ("actual_TCP_speed_0", None, None, 0, None),
        ("position_error_1", None, None, 1, None),
        ("status", None, None, None, None),
        ("Istwinkel Achse 3 [°]", "position", None, 3, "deg"),
        ("Gelenkwinkel_2", "position", None, 2, None),
        ("Drehmoment A1 (Nm)", "effort", None, 1, "N m"),
        ("Motorstrom[4]", "effort", None, 4, None),
        ("Drehzahl 2 [U/min]", "velocity", None, 2, "rpm"),
        ("Zeit [ms]", "time", None, None, "ms"),
        ("Greiferposition 1", None, None, 1, None),
        ("temps", "time", None, None, None),
        ("Temps (s)", "time", None, None, "s"),
        ("temps_3", "temperature", None, 3, None),
        ("vitesse mesurée axe 5 (deg/s)", "velocity", None, 5, "deg/s"),
        ("Accélération 1", "acceleration", None, 1, None),
        ("couple_articulation_6", "effort", None, 6, None),
        ("qDot[2]", "velocity", None, 2, None),
        ("q_dot_3", "velocity", None, 3, None),
        ("qDDot[2]", "acceleration", None, 2, None),
        ("q_ddot_1", "acceleration", None, 1, None),
        ("theta_dot_dot_1", "acceleration", None, 1, None),
        ("elbow.pos_dot", "velocity", 2, None, None),
        ("dtheta1", "velocity", None, 1, None),
        ("dot_3", None, None, 3, None),
        ("ActPos[0]", "position", None, 0, None),
        ("AktVel_2", "velocity", None, 2, None),
        ("IstSpd2", "velocity", None, 2, None),
        ("ActCur[4]", "effort", None, 4, None),
        ("actcurr_1", "effort", None, 1, None),
        ("Akt.Trq[1] (Nm)", "effort", None, 1, "N m"),
        ("ActTorque1", "effort", None, 1, None),
        ("IstAmp_3", "effort", None, 3, None),
        ("elbow_amps", "effort", 2, None, "A"),
        ("cur_pos_1", "position", None, 1, None),
        ("CurrentVel[1]", "velocity", None, 1, None),
        ("current_temp_1", "temperature", None, 1, None),
        ("cur_time", "time", None, None, None),
        ("Current Time (ms)", "time", None, None, "ms"),
        ("current_t_1", "effort", None, 1, None),
        ("amp_status_1", None, None, 1, None),
        ("AmpTemp1", "temperature", None, 1, None),
        ("Amp[1]", None, None, 1, None),
        ("Amplitude 1", None, None, 1, None),
        ("Action[1]", None, None, 1, None),
        ("cursor_1", None, None, 1, None),
        # A number of more digits than Python reads.
        ("position_" + 5000 * "9", "position", None, None, None),
    ],
)
def test_a_name_says_quantity_joint_and_unit(name, quantity, joint, number, unit):
    said = meaning(name, UR)
    assert (said.quantity, said.joint, said.number, said.unit) == (quantity, joint, number, unit)


def test_a_prefix_of_all_joints_may_be_left_out_and_ambiguous_short_names_count_for_none():
    panda = ("panda_joint1", "panda_joint2")
    assert meaning("joint2/pos", panda).joint == 1
    assert meaning("elbow_pos", ("elbow_joint", "elbow_link")).joint is None
    assert meaning("joint10_pos", tuple(f"joint{k}" for k in range(1, 11))).joint == 9


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        ("Säule Istposition [°]", 0),
        ("Rucken Istposition", 3),
        ("SÄULE_POS", 0),
        ("Saeule.position", 0),
        ("Fußgelenk Winkel", 1),
        ("épaule position", 2),
        ("EpaulePosition", 2),
        ("Ruecken pos", 3),
        ("Rücken pos", 3),
        ("Hubsäule pos", None),
    ],
)
def test_umlauts_and_accents_may_be_written_out_in_the_column_or_in_the_urdf(name, joint):
    said = meaning(name, ("saeule", "fussgelenk", "epaule", "rücken"))
    assert said.joint == joint
    assert joint is None or said.template.startswith("{joint}")


@pytest.mark.parametrize(
    ("name", "commanded", "measured"),
    [
        ("Sollposition A1", True, False),
        ("IstPosition A1", False, True),
        ("consigne couple 2", True, False),
        ("angle mesuré 2", False, True),
        ("AktPos_2", False, True),
        ("actpos 2", False, True),
        ("Motormoment_1", False, False),
    ],
)
def test_german_and_french_say_what_was_asked_for_and_what_was_sensed(name, commanded, measured):
    said = meaning(name)
    assert (said.commanded, said.measured) == (commanded, measured)
    assert said.template.count("{number}") == 1


def test_a_torque_of_now_is_no_current():
    assert "current" not in meaning("current_torque_1").words and "cur" in meaning("ActCur[1]").words


def table(*signals: str) -> dict[str, np.ndarray]:
    rows = [MADE["time"], *(MADE[f"{joint}.{signal}"] for signal in signals for joint in JOINTS)]
    return {f"column_{k + 1}": row for k, row in enumerate(rows)}


def told(columns: dict[str, np.ndarray], counts: tuple[int, ...] = (3, 2)) -> list[str]:
    return [f"{said.quantity} {said.number}" for said in meanings_by_place(columns, counts).values()]


def test_two_blocks_are_positions_and_efforts():
    assert told(table("position", "effort")) == ["time None", "position 1", "position 2", "effort 1", "effort 2"]


def test_of_three_the_second_has_to_be_the_slope_of_the_first():
    assert told(table("position", "velocity", "effort"))[3:5] == ["velocity 1", "velocity 2"]
    assert told(table("velocity", "position", "effort"), (2,)) == []


@pytest.mark.parametrize("turn", [2.0 * np.pi, 360.0])
def test_an_angle_that_is_held_within_one_turn_has_the_slope_of_the_whole_one(turn: float):
    """Of a log of joints that turn on and on, held between half a turn either way, nothing was told."""
    columns = table("position", "velocity", "effort")
    last = columns["column_1"][-1]
    share = columns["column_1"] / last
    whole = turn * np.array([np.sin(2.0 * share), 2.0 * share**2])
    slope = turn / last * np.array([2.0 * np.cos(2.0 * share), 4.0 * share])
    columns |= {f"column_{k + 2}": (row + turn / 2) % turn - turn / 2 for k, row in enumerate(whole)}
    columns |= {f"column_{k + 4}": row for k, row in enumerate(slope)}
    assert np.ptp(columns["column_3"]) > 0.9 * turn
    assert told(columns, (2,))[3:5] == ["velocity 1", "velocity 2"]
    # What jumps by anything else is no angle, and what is not the slope is none of a whole turn either.
    assert told(columns | {"column_5": slope[0]}, (2,)) == []
    assert told(columns | {"column_3": whole[1] % (0.7 * turn)}, (2,)) == []


def test_behind_velocities_that_are_slopes_there_may_be_more_of_each_joint():
    """A log of six positions, velocities, currents and two setpoints of each was told nothing."""
    first = ["time None", "position 1", "position 2", "velocity 1", "velocity 2", "effort 1", "effort 2"]
    assert told(table("position", "velocity", "effort", "effort", "effort")) == first
    assert told(table("position", "position", "effort", "effort")) == []
    assert told(dict(list(table("position", "velocity", "effort", "effort").items())[:-1])) == []


def test_other_numbers_of_columns_say_nothing():
    columns = table("position", "effort")
    assert told(columns, (3,)) == []
    assert told({"column_0": np.zeros(600)} | columns) == []


@pytest.mark.parametrize("name", ["position/time", "arm/torque/time [s]", "pos/Time (ms)", "Force.time"])
def test_the_clock_of_a_group_is_no_position(name: str):
    assert meaning(name).quantity == "time"
    assert meaning(name.replace("ime", "orque")).quantity != "time"


@pytest.mark.parametrize("name", ["Theta1.time", "/joint_2/position/stamp", "elbow.torque.time"])
def test_the_clock_of_one_joint_is_neither_its_position_nor_the_arms(name: str):
    """Of structures with time, as block diagrams save them, the times of the first were taken for the positions."""
    said = meaning(name, ("shoulder", "elbow"))
    assert said.quantity is None


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("elbow position [mm]", "{joint} position"),
        ("elbow_pos_deg", "{joint}_pos"),
        ("q3 (rad)", "q{number}"),
        ("elbow position [filtered]", "{joint} position [filtered]"),
        ("elbow", "{joint}"),
    ],
)
def test_the_stem_of_a_name_is_without_its_unit(name: str, stem: str):
    assert meaning(name, ["shoulder", "elbow"]).stem == stem
