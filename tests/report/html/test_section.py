"""Sections that installed packages add to reports."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import pytest

from scara_ident.cli.console import check_report
from scara_ident.errors import ScaraIdentError
from scara_ident.report.html.blocks import Block, Cell, Group, Paragraph, Table
from scara_ident.report.html.identification import IdentificationContext, identification_report
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import ADDED, added_sections
from scara_ident.report.plot import Line, Panel, Plot, single
from tests.report.html.document import data_of, document


@dataclass(frozen=True)
class Energy:
    """A section as an installed package has it."""

    id: str = "energy"
    title: str = "Energy & <heat>"
    kinds: tuple[str, ...] = ("identification", "paper")

    def build(self, context: str) -> list[Block]:
        plot = Plot("time [s]", (Panel("power [W]", (Line([0.0, 1.0], [1.0, 2.0], "blue", "power"),)),))
        table = Table(("name", "value"), [[Cell("<b>", "name"), "1"]], (1,))
        return [Paragraph(context), table, Group("energy-group", (single("energy-0", "Power", "", plot),))]


class Fails(Energy):
    def build(self, context: str) -> list[Block]:
        raise RuntimeError("no\nluck")


class Bare:
    """What is no section."""

    id = "bare"


OTHER_KIND = Energy(kinds=("novel",))


@pytest.fixture
def installed(monkeypatch):
    def install(*names: str) -> None:
        points = {f"my-{name.lower()}": f"{__name__}:{name}" for name in names}
        monkeypatch.setitem(
            ADDED.__dict__, "_installed", {k: [EntryPoint(k, v, ADDED.group)] for k, v in points.items()}
        )

    return install


def test_a_package_adds_its_section_to_its_kinds_of_report(installed, tmp_path):
    installed("Energy")
    assert added_sections("comparison") == ()
    page = Page("title", "sub", ("verdict",), parts("identification", (), "words of <it>"))
    page.write(tmp_path / "report.html")
    found = document(tmp_path / "report.html")
    assert found.wrong == []
    assert found.sections == ["energy"]
    assert "Energy & <heat>" in found.words
    assert "words of <it>" in found.words
    assert list(data_of(tmp_path / "report.html")["figures"]) == ["energy-0"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Fails", r"report section 'energy' of Fails cannot be built \(RuntimeError: no luck\)"),
        ("Bare", r"report section 'my-bare' of .* cannot be loaded \(TypeError: it has no title and no kinds and no b"),
        (
            "OTHER_KIND",
            r"report section 'my-other_kind' of .*there is no report of kind novel; kinds are identification",
        ),
        ("Missing", r"report section 'my-missing' of .*Missing"),
    ],
)
def test_a_broken_section_is_one_line_that_names_it(installed, name, said):
    installed(name)
    with pytest.raises(ScaraIdentError) as caught:
        parts("identification", (), "words")
    assert re.match(said, str(caught.value))
    assert "\n" not in str(caught.value)


def test_two_sections_of_one_id_are_reported(installed):
    installed("Energy")
    with pytest.raises(ScaraIdentError, match="energy: two sections of the report have this id"):
        parts("identification", (Energy(),), "words")


def test_a_section_with_nothing_to_say_is_left_out(installed):
    installed()

    class Empty(Energy):
        def build(self, context: str) -> list[Block]:
            return []

    assert parts("identification", (Empty(),), "words") == []


def test_a_broken_section_is_reported_before_the_work(installed, tmp_path):
    installed("Bare")
    check_report(None, "paper")
    with pytest.raises(ScaraIdentError, match="my-bare"):
        check_report(tmp_path, "paper")


def test_the_section_of_the_documentation_is_drawn(monkeypatch, result, tmp_path):
    page = Path(__file__).parents[3] / "docs" / "howto" / "my-own-section.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    package = ModuleType("my_package")
    exec(code, package.__dict__)
    monkeypatch.setitem(sys.modules, "my_package", package)
    point = EntryPoint("power", "my_package:Power", ADDED.group)
    monkeypatch.setitem(ADDED.__dict__, "_installed", {"power": [point]})
    identification_report(tmp_path / "report.html", IdentificationContext(result))
    assert document(tmp_path / "report.html").sections[-1] == "power"
    assert {"power-0", "power-1"} <= set(data_of(tmp_path / "report.html")["figures"])
