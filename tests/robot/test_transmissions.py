"""Drives as the transmissions of a URDF and the description have them."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.description import JointDescription
from scara_ident.robot.transmissions import reductions, rotor_inertias

URDF = Path("arm.urdf")
NAMES = ("j1", "j2", "j3")
BARE = (JointDescription(),) * 3


def tree(*actuators: tuple[str, str]) -> ElementTree.Element:
    """Return transmissions of a joint and what its actuator states."""
    parts = (
        f'<transmission><joint name="{joint}"/><actuator>{text}</actuator></transmission>' for joint, text in actuators
    )
    return ElementTree.fromstring(f"<robot>{''.join(parts)}</robot>")


def test_each_joint_has_the_drive_of_its_own_transmission():
    given = tree(
        ("j3", "<mechanicalReduction>-80.5</mechanicalReduction><rotorInertia>2e-4</rotorInertia>"),
        ("j1", "<mechanical_reduction>100</mechanical_reduction>"),
    )
    np.testing.assert_array_equal(reductions(NAMES, BARE, URDF, given), [100.0, 1.0, -80.5])
    np.testing.assert_array_equal(rotor_inertias(NAMES, BARE, URDF, given), [np.nan, np.nan, 2e-4])


def test_the_description_wins_and_a_rotor_of_zero_is_a_statement():
    given = tree(("j1", "<mechanicalReduction>100</mechanicalReduction><rotorInertia>2e-4</rotorInertia>"))
    own = (JointDescription(reduction=-50.0, rotor_inertia=0.0), *BARE[1:])
    np.testing.assert_array_equal(reductions(NAMES, own, URDF, given), [-50.0, 1.0, 1.0])
    np.testing.assert_array_equal(rotor_inertias(NAMES, own, URDF, given), [0.0, np.nan, np.nan])


@pytest.mark.parametrize("text", ["", "fast", "nan", "inf"])
def test_what_is_no_number_is_refused_with_joint_and_element(text: str):
    with pytest.raises(
        RobotError, match=r"^arm\.urdf: transmission of j2: rotorInertia is .*expected a number: correct or remove it"
    ):
        rotor_inertias(NAMES, BARE, URDF, tree(("j2", f"<rotorInertia>{text}</rotorInertia>")))


def test_what_is_no_number_does_not_matter_where_the_description_states_it():
    # As in the URDF of a maker that left a placeholder behind.
    left = tree(("j2", "<mechanicalReduction>reduction</mechanicalReduction><rotorInertia>inertia</rotorInertia>"))
    own = (BARE[0], JointDescription(reduction=100.0, rotor_inertia=2e-5), BARE[2])
    np.testing.assert_array_equal(reductions(NAMES, own, URDF, left), [1.0, 100.0, 1.0])
    np.testing.assert_array_equal(rotor_inertias(NAMES, own, URDF, left), [np.nan, 2e-5, np.nan])
    with pytest.raises(RobotError, match=r"is 'reduction'; .* state reduction of j2 in robot\.yaml"):
        reductions(NAMES, BARE, URDF, left)


def test_a_reduction_of_zero_is_refused():
    with pytest.raises(RobotError, match="transmission of j2: mechanicalReduction is 0"):
        reductions(NAMES, BARE, URDF, tree(("j2", "<mechanicalReduction>0</mechanicalReduction>")))
