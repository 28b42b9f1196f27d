"""The page on contact says what was counted, where the results are kept."""

from __future__ import annotations

import json

import pytest

from tests.shared import ROOT

PAGE = (ROOT / "docs" / "howto" / "detect-contact.md").read_text(encoding="utf-8")
LABELS = {
    "scara03": "virtual SCARA03",
    "ur5": "virtual UR5",
    "panda": "virtual Panda",
    "ur10e": "measured UR10e",
    "ur10e_residuals": "virtual UR10e, measured residuals",
}


def test_every_result_has_its_rows():
    kept = (ROOT / "benchmarks" / "results").glob("contact_*.json")
    assert {path.stem.removeprefix("contact_") for path in kept} == set(LABELS)


@pytest.mark.parametrize("name", LABELS)
def test_the_rows_are_those_of_the_results(name: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    contact = pytest.importorskip("contact", reason="benchmarks are not part of an installed package")
    found = json.loads((ROOT / "benchmarks" / "results" / f"contact_{name}.json").read_text(encoding="utf-8"))
    cells = [row.split("|")[2:] for row in contact.table(found)[2 : 2 + len(found["false_alarms"])]]
    lines = PAGE.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(f"| {LABELS[name]} |"))
    assert [line.split("|")[2:] for line in lines[first : first + len(cells)]] == cells
