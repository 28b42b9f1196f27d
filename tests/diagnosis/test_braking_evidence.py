"""Friction that pushes is no arm's, though what is left beside it is noise."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.braking_evidence import braking_evidence
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.estimation import wls
from scara_ident.report.diagnosis_words import sentences
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, observed, with_torque

SHOWN = tuple(Evidence(joint, True, "repetition", "", 0.1) for joint in ("joint1", "joint2"))


def pushed():
    """Runs in which something takes four times the speed of the first joint off the torque recorded."""
    return with_torque(exact_runs(), 0, lambda motion: -4.0 * motion.v[0])


def test_friction_that_pushes_is_reported_on_its_joint_alone():
    training = observed(pushed())
    first, second = braking_evidence(SHOWN, wls(training), training, ())
    assert (first.shown, first.lacks) == (False, True)
    assert first.why.startswith("its friction pushes with ")
    assert second is SHOWN[1]


def test_friction_that_brakes_is_not():
    training = observed(list(exact_runs()))
    assert braking_evidence(SHOWN, wls(training), training, ()) == SHOWN


@pytest.mark.parametrize(("joint", "asked"), [("joint1", False), ("joint2", True), (None, True)])
def test_a_joint_with_an_effect_of_its_own_is_not_asked(joint: str | None, asked: bool):
    training = observed(pushed())
    first, _ = braking_evidence(SHOWN, wls(training), training, [SimpleNamespace(joint=joint)])
    assert first.lacks is asked


def test_a_model_whose_friction_pushes_is_not_complete():
    """Of a measured arm friction of 18 N m against the motion was said to be nothing: `record more`. Beside noise it was `complete`."""
    found = diagnose(load_robot(), pushed(), bands=BANDS, catalogue=())
    assert found.verdict == "undecided"
    assert (
        sentences(found)[0] == "Undecided: something is missing on joint1, but these recordings cannot show what it is."
    )
    assert any("its friction pushes with" in said for said in sentences(found))
