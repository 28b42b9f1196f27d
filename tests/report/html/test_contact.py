"""The report of contacts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

from scara_ident.report.html.contact import _contacts, contact_figures
from scara_ident.robot.robot import load_robot
from tests.report.html.document import data_of, document


def test_contacts_stand_in_a_table_and_over_time(touched, touched_page):
    assert touched.contacts
    page, data = document(touched_page), data_of(touched_page)
    assert (page.wrong, page.open) == ([], [])
    assert page.sections == ["contacts", "torque", "thresholds"]
    shaded = [
        [layer["t"] for panel in data["figures"]["external"]["variants"][str(k)]["panels"] for layer in panel["layers"]]
        for k in (0, 1)
    ]
    assert [kinds.count("region") for kinds in shaded] == [0, 6 * len(touched.contacts)]
    assert len(contact_figures(touched)) == 6
    assert "explains the torque of 3 joints or more" in page.words


def test_on_a_small_arm_all_joints_tell_the_place(touched):
    """Of a two-joint arm no three joints can be explained."""
    small = SimpleNamespace(known=SimpleNamespace(robot=load_robot()))
    each = replace(touched.contacts[0], joints=("joint1",))
    words, _ = _contacts(replace(touched, observer=small, contacts=(each,)))
    assert "explains the torque of all joints; otherwise" in words.text
