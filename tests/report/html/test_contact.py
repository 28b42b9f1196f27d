"""The report of contacts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.report.html.contact import contact_figures, contact_report
from scara_ident.use.contact import contact_observer, look_for_contact
from tests.report.html.document import data_of, document
from tests.use.quiet import known_ur5, pushed, quiet


def test_contacts_stand_in_a_table_and_over_time(tmp_path: Path):
    observer = contact_observer(known_ur5(), [quiet(seed, 12.0) for seed in range(2)])
    found = look_for_contact(observer, [quiet(9, 12.0), pushed(quiet(7, 12.0), np.array([60.0, 0.0, 60.0]), 6.0, 7.0)])
    assert found.contacts
    contact_report(tmp_path / "report.html", found)
    page, data = document(tmp_path / "report.html"), data_of(tmp_path / "report.html")
    assert (page.wrong, page.open) == ([], [])
    assert page.sections == ["contacts", "torque", "thresholds"]
    shaded = [
        [layer["t"] for panel in data["figures"]["external"]["variants"][str(k)]["panels"] for layer in panel["layers"]]
        for k in (0, 1)
    ]
    assert [kinds.count("region") for kinds in shaded] == [0, 6 * len(found.contacts)]
    assert len(contact_figures(found)) == 6
