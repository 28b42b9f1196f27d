"""The report of contacts."""

from __future__ import annotations

from scara_ident.report.html.contact import contact_figures
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
