from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation.consistent.nominal import nominal
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf
from tests.estimation.consistent.arms import panda, smallest_eigenvalue_share, ur5

LINKS = (Link(), Link(xyz=(0.3, 0.0, 0.0), axis=(0.0, 1.0, 0.0)))


def arm(folder, *links):
    return load_robot(write_urdf(folder / "arm.urdf", links))


@pytest.mark.parametrize("robot", [load_robot, ur5, panda], ids=["scara03", "ur5", "panda"])
def test_nominal_bodies_are_positive_definite_and_give_back_the_standard_parameters(robot):
    found = nominal(robot())
    standard = found.to_standard @ found.relative
    for body in standard[: 10 * found.n].reshape(-1, 10):
        assert smallest_eigenvalue_share(body) > 1e-8
    given = robot().standard_parameters()
    size = np.abs(given[: 10 * found.n]).max()
    # The Panda's second link is a plate in its URDF; it is thickened a little.
    np.testing.assert_allclose(standard[: 10 * found.n], given[: 10 * found.n], atol=1e-4 * size)


def test_a_known_rotor_is_kept_and_an_unknown_one_is_guessed_as_everywhere(tmp_path):
    scara = load_robot()
    np.testing.assert_allclose(nominal(scara).armature, scara.reduction**2 * scara.rotor_inertia)
    assert nominal(scara).notes == ()
    robot = arm(tmp_path, Link(mass=2.0, com=(0.1, 0.0, 0.0), inertia=(0.1, 0.2, 0.3)))
    robot = replace(robot, effort_limit=np.array([np.inf]))
    found = nominal(robot)
    assert found.armature[0] == pytest.approx(0.1 * (0.3 + 2.0 * 0.1**2))
    assert "stated neither in the URDF nor in robot.yaml" in found.notes[0]
    np.testing.assert_allclose(nominal(ur5()).armature, ur5().rotor_guess.armature)
    empty = arm(tmp_path, Link(mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0)))
    assert nominal(replace(empty, effort_limit=np.array([np.inf]))).armature[0] > 0.0


def test_links_without_mass_extent_or_sense_are_replaced_and_reported(tmp_path):
    cases = {
        "gives no mass": Link(mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0)),
        "gives a point mass": Link(mass=1.0, inertia=(0.0, 0.0, 0.0)),
        "triangle inequality": Link(mass=1.0, inertia=(0.01, 0.01, 0.05)),
    }
    for words, link in cases.items():
        found = nominal(arm(tmp_path, LINKS[0], link))
        assert any(words in note and note.startswith("l2:") for note in found.notes), words
        assert np.linalg.eigvalsh(found.pseudo_inertia[1])[0] > 0.0
