"""Forces on the tool, beside it and farther in, told from the torque that they make."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.robot.kinematics import tool_placement
from scara_ident.use.contact import Contact, contacts_dict, look_for_contact
from scara_ident.use.observer import ContactObserver, contact_observer
from tests.arms import ur5
from tests.use.quiet import known_ur5, pushed, quiet

FORCE = np.array([30.0, -20.0, 40.0])


@pytest.fixture(scope="module")
def observer() -> ContactObserver:
    return contact_observer(known_ur5(), [quiet(seed) for seed in range(3)], rate=1.0)


def contact(observer: ContactObserver, seed: int, force: np.ndarray, **where) -> Contact:
    found = look_for_contact(observer, [pushed(quiet(seed), force, 8.0, 9.0, **where)]).contacts
    (own,) = (each for each in found if 8.0 <= each.start < 9.0)
    return own


def off(found: Contact, force: np.ndarray) -> float:
    """How far a stated force is off, in standard deviations along the axis where that is most."""
    return float(np.max(np.abs(found.force - force) / np.sqrt(np.diag(found.force_covariance))))


def test_a_force_on_the_tool_is_placed_there(observer: ContactObserver):
    found = contact(observer, 7, FORCE)
    assert found.estimate.at_tool
    assert (found.place, found.estimate.point, found.estimate.point_std) == ("tool", None, None)
    assert off(found, FORCE) < 2.0


@pytest.mark.slow
def test_a_force_beside_the_tool_is_reported_with_its_point(observer: ContactObserver):
    # As if on the tool it would be too small, or turned.
    rng, placed = np.random.default_rng(1), 0
    turn, origin = tool_placement(ur5())
    for seed in range(20, 28):
        force, beside = (size * part / np.linalg.norm(part) for size, part in zip((80.0, 0.1), rng.standard_normal((2, 3)), strict=True))  # fmt: skip
        found = contact(observer, seed, force, beside=beside)
        if found.force is None:
            continue
        assert found.place == "wrist_3_link"
        assert off(found, force) < 3.0
        np.testing.assert_allclose(found.force, force, atol=0.1 * 80.0)
        # Along the force no point is told from another.
        assert np.all(np.abs(turn @ beside + origin - found.estimate.point) < 3.0 * found.estimate.point_std)
        placed += 1
    # The others load the last joint too little to tell them from a force on the link before.
    assert placed >= 4


def test_the_entry_has_the_point(observer: ContactObserver):
    found = look_for_contact(observer, [pushed(quiet(7), 2.0 * FORCE, 8.0, 9.0, beside=np.array([0.0, 0.1, 0.05]))])
    (entry,) = contacts_dict(found)["contacts"]
    assert entry["place"] == "wrist_3_link"
    assert entry["point"] == found.contacts[0].estimate.point.tolist()
    assert entry["point_std"] == found.contacts[0].estimate.point_std.tolist()
    assert len(entry["force"]) == 3


def test_no_force_beside_the_tool_is_reported_where_the_last_joint_is_not_loaded(observer: ContactObserver):
    found = contact(observer, 8, 2.0 * FORCE, joints=4)
    assert (found.place, found.force, found.estimate.point) == ("wrist_1_link", None, None)
