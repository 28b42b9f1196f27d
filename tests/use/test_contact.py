"""Contacts in recordings with known pushes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.files import json_text
from scara_ident.use.contact import Contact, contacts_dict, look_for_contact, sentences
from scara_ident.use.contact_force import ContactForce
from scara_ident.use.observer import ContactObserver, contact_observer
from tests.use.quiet import known_ur5, moved_from, pushed, quiet, stopping

FORCE = np.array([30.0, -20.0, 40.0])


@pytest.fixture(scope="module")
def observer() -> ContactObserver:
    return contact_observer(known_ur5(), [quiet(seed) for seed in range(3)], rate=1.0)


@pytest.mark.slow
def test_a_push_on_the_tool_is_found_with_its_force(observer: ContactObserver):
    found = look_for_contact(observer, [pushed(quiet(7), FORCE, 8.0, 9.0), quiet(8)])
    (contact,) = found.contacts
    assert contact.recording == "pushed"
    assert 8.0 <= contact.start < 8.2
    assert 9.0 <= contact.stop < 9.3
    assert (contact.place, contact.explained > 0.9) == ("tool", True)
    # The observer's low-pass counts: all of the force is told.
    np.testing.assert_allclose(contact.force, FORCE, atol=0.05 * np.linalg.norm(FORCE))
    content = contacts_dict(found)
    assert content["contacts"][0]["joints"] == list(contact.joints)
    std = np.sqrt(np.diag(contact.force_covariance))
    assert content["contacts"][0]["force_std"] == std.tolist()
    size, said = np.linalg.norm(contact.force), contact.force_words.split()
    assert (float(said[0]), said[1], said[3]) == (pytest.approx(size, rel=5e-3), "±", "N")
    assert np.min(std) / 2.0 < float(said[2]) < 2.0 * np.max(std)
    assert content["false_alarms"]["per_hour"] == 1.0
    assert content["summary"][0].startswith("1 contact in 39.98 s of motion; 0.011")
    assert "extrapolated" in " ".join(content["summary"])
    assert json_text(content)


@pytest.mark.slow
def test_what_loads_inner_joints_only_is_on_their_link(observer: ContactObserver):
    found = look_for_contact(observer, [pushed(quiet(7), 2.0 * FORCE, 8.0, 9.0, joints=2)])
    assert {each.place for each in found.contacts} == {"upper_arm_link"}
    assert found.contacts[0].force is None
    assert "the contact is on the named link or farther out" in " ".join(sentences(found))


@pytest.mark.slow
def test_a_joint_that_stands_still_by_friction_is_not_loaded_by_a_contact():
    # Friction holds each joint at any torque up to its threshold: of a push farther in nothing shows on the wrist.
    own = contact_observer(known_ur5(), [stopping(seed) for seed in range(10)], rate=10.0)
    found = look_for_contact(own, [pushed(stopping(seed), FORCE, 6.2, 7.8, joints=2) for seed in range(20, 32)])
    during = [each for each in found.contacts if 6.2 <= each.start < 7.8]
    assert len(during) >= 10
    assert {each.place for each in during} <= {"shoulder_link", "upper_arm_link"}
    # Where it moves, the same push on all joints is on the tool.
    whole = look_for_contact(own, [pushed(stopping(20), FORCE, 4.4, 5.6)]).contacts
    assert "tool" in {each.place for each in whole if 4.4 <= each.start < 5.0}


@pytest.mark.slow
def test_stated_forces_are_as_sure_as_they_say(observer: ContactObserver):
    rng = np.random.default_rng(3)
    off, stds = [], []
    for seed in range(20, 32):
        direction = rng.standard_normal(3)
        force = 60.0 * direction / np.linalg.norm(direction)
        for each in look_for_contact(observer, [pushed(quiet(seed), force, 8.0, 9.0)]).contacts:
            if each.force is not None:
                std = np.sqrt(np.diag(each.force_covariance))
                off.append((each.force - force) / std)
                stds.append(std)
    assert len(off) >= 10
    assert np.mean(np.abs(off) < 2.0) > 0.9
    # And no less sure than that by far, though it counts what another point on the link would make of it, and the residual as
    # if it were the same throughout.
    assert np.sqrt(np.mean(np.square(off))) > 0.1
    assert np.median(stds) < 0.2 * 60.0


def test_a_force_that_is_hardly_known_is_said_without_an_exponent():
    estimate = ContactForce(0.9, True, np.array([0.0, 12.0, 0.0]), np.diag([1.0, 900.0, 1.0]))
    assert Contact("run", 1.0, 1.2, ("joint",), 1.1, np.zeros(1), "tool", estimate).force_words == "12 ± 30 N"


@pytest.mark.slow
def test_a_force_that_turns_in_the_arms_frame_is_reported_in_the_bases(observer: ContactObserver):
    # The first joint turns by a quarter while it lasts; what the low-pass shows lags behind by an eighth of a radian.
    run = quiet(7)
    turning = replace(run, position=run.position + np.array([[1.5], *[[0.0]] * 5]) * run.time, velocity=None)
    free = [
        replace(item, position=item.position + np.array([[1.5], *[[0.0]] * 5]) * item.time, velocity=None)
        for item in (quiet(seed) for seed in range(3))
    ]
    own = contact_observer(known_ur5(), free, rate=1.0)
    (found,) = (
        each for each in look_for_contact(own, [pushed(turning, 2.0 * FORCE, 8.0, 9.0)]).contacts if each.start > 7.0
    )
    np.testing.assert_allclose(found.force, 2.0 * FORCE, atol=0.06 * 2.0 * np.linalg.norm(FORCE))


def test_near_a_singular_pose_no_force_is_reported(observer: ContactObserver):
    # Upright, with all axes but the first and the last but one parallel: what pushes down is not felt.
    held = moved_from(quiet(7), np.array([0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0]), 1e-2)
    found = look_for_contact(observer, [pushed(held, 4.0 * FORCE, 8.0, 9.0)])
    during = [each for each in found.contacts if 8.0 <= each.start < 8.3]
    assert during
    assert all(each.force is None and each.force_words == "-" for each in during)
    assert all(each.entry["force_std"] is None for each in during)
    unsure = "Near a singular pose the force on the tool is not determined."
    assert (unsure in sentences(found)) == any(each.place == "tool" and each.force is None for each in found.contacts)
