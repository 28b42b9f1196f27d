"""A rotor that is less than nothing stands for something that the model lacks, though what is left beside it is noise."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.possible_evidence import possible_evidence
from scara_ident.estimation import wls
from scara_ident.report.diagnosis_words import sentences
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, observed, with_torque

SHOWN = tuple(Evidence(joint, True, "repetition", "", 0.1) for joint in ("joint1", "joint2"))


def pulled():
    """Runs in which something that goes with the second joint's acceleration takes more than its rotor off the torque."""
    return with_torque(exact_runs(), 1, lambda motion: -0.1 * motion.a[1])


def test_a_rotor_below_zero_is_reported_on_its_joint_alone():
    first, second = possible_evidence(SHOWN, wls(observed(pulled())), ())
    assert first is SHOWN[0]
    assert (second.shown, second.lacks) == (False, True)
    assert second.why.startswith("P_d5 (")
    assert "which no body or rotor can have" in second.why


def test_bodies_and_rotors_above_zero_are_not():
    assert possible_evidence(SHOWN, wls(observed(list(exact_runs()))), ()) == SHOWN


@pytest.mark.parametrize(("joint", "asked"), [("joint2", False), ("joint1", True), (None, True)])
def test_a_joint_with_an_effect_of_its_own_is_not_asked(joint: str | None, asked: bool):
    _, second = possible_evidence(SHOWN, wls(observed(pulled())), [SimpleNamespace(joint=joint)])
    assert second.lacks is asked


def test_a_model_with_a_rotor_below_zero_is_not_complete():
    """A slide that a constant force pulled down had a rotor of -0.47 ± 0.01 kg m^2, and nothing said so."""
    found = diagnose(load_robot(), pulled(), bands=BANDS, catalogue=())
    assert found.verdict == "undecided"
    assert (
        sentences(found)[0] == "Undecided: something is missing on joint2, but these recordings cannot show what it is."
    )
    assert any("which no body or rotor can have" in said for said in sentences(found))
