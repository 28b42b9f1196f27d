"""The page: sections assembled by templates into one file that needs no network."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from scara_ident.errors import ScaraIdentError
from scara_ident.files import write_text
from scara_ident.report.html.blocks import Arm, Beside, Block, Folded, Gains, Group, superscripts
from scara_ident.report.html.section import Kind, Section, added_sections

# Sentences below the verdict that are all shown, at the most; of more only the first are.
MAX_SENTENCES, FIRST_SAID = 6, 4


@dataclass(frozen=True, eq=False)
class Part:
    """A section whose content is there."""

    id: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, eq=False)
class Page:
    """A page.

    Attributes
    ----------
    verdict : sequence of str
        The first is the verdict in a sentence.
    warn : bool
        Whether the verdict is bad news.
    picture : Gains, optional
        Below the verdict's first sentence.
    """

    title: str
    subtitle: str
    verdict: Sequence[str]
    parts: Sequence[Part]
    warn: bool = False
    picture: Gains | None = None

    @property
    def shown(self) -> Sequence[str]:
        """What stands below the verdict's first sentence: what comes first of the others, and what asks something."""
        others = self.verdict[1:]
        return [
            said
            for k, said in enumerate(others)
            if len(others) <= MAX_SENTENCES or k < FIRST_SAID or said.endswith("?")
        ]

    @property
    def folded(self) -> Sequence[str]:
        """The sentences that are shown on demand."""
        return [said for said in self.verdict[1:] if said not in self.shown]

    def render(self) -> str:
        """Return the whole file's text."""
        blocks = [block for part in self.parts for block in _flat(part.blocks)]
        figures = {
            figure.name: figure.spec() for block in blocks if isinstance(block, Group) for figure in block.figures
        }
        arms = {block.name: block.spec() for block in blocks if isinstance(block, Arm)}
        return page_template().render(page=self, data={"figures": figures, "arms": arms})

    def write(self, path: Path) -> None:
        """Write the page, whole or not at all."""
        write_text(path, self.render())


def parts(kind: Kind, sections: Sequence[Section], context: Any) -> list[Part]:
    """Build the sections of a report, those of installed packages last; empty ones are left out.

    Raises
    ------
    ScaraIdentError
        In one line, if a section of an installed package fails or has the id of another.
    """
    found: dict[str, Part] = {}
    for section in (*sections, *added_sections(kind)):
        blocks = section.build(context)
        if section.id in found:
            raise ScaraIdentError(f"report section {section.id}: two sections of the report have this id; rename one")
        if blocks:
            found[section.id] = Part(section.id, section.title, blocks)
    return list(found.values())


def page_template() -> Template:
    """Return the template of a page; what it consists of is compiled when it is first asked for."""
    templates = _environment()
    templates.get_template("blocks.html")
    return templates.get_template("page.html")


def _flat(blocks: Sequence[Block]) -> list[Block]:
    found: list[Block] = []
    for block in blocks:
        inner = block.blocks if isinstance(block, Beside) else (block.inside,) if isinstance(block, Folded) else ()
        found += _flat(inner) if inner else [block]
    return found


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("scara_ident.report.html"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    environment.globals["asset"] = asset
    environment.filters |= {"typeset": typeset, "breakable": breakable}
    return environment


def typeset(text: str) -> str:
    """Return words as the page sets them: powers raised, a number on one line with its unit, a space before %."""
    return re.sub(r"(?<=\d) ?%", "\u00a0%", superscripts(text).replace("N m", "N\u00a0m"))


def breakable(text: str) -> Markup:
    """Return a name that paper and phones may break between its words."""
    return Markup("<wbr>").join(map(escape, re.split(r"(?<=[_.])(?=[^\W\d])", text)))


def asset(name: str) -> str:
    """Return the text of a file that is put into every page."""
    return (files("scara_ident.report.html") / "assets" / name).read_text(encoding="utf-8")
