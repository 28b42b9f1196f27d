"""What a page holds."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


@dataclass
class Document(HTMLParser):
    """What a page holds."""

    open: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    sections: list[str] = field(default_factory=list)
    figures: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    identities: list[str] = field(default_factory=list)
    scripts: dict[str, str] = field(default_factory=dict)
    words: str = ""
    _script: str | None = None

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)

    def handle_starttag(self, tag, attrs):
        given_ = dict(attrs)
        self.loads += [given_[key] for key in ("src", "href", "srcset", "data", "action") if given_.get(key)]
        if "id" in given_:
            self.identities.append(given_["id"])
        if tag == "section":
            self.sections.append(given_["id"])
        if "data-figure" in given_:
            self.figures.append(given_["data-figure"])
        if tag == "script":
            self._script = given_.get("id") or f"script {len(self.scripts)}"
            self.scripts[self._script] = ""
        if tag not in ("meta", "link", "br", "input", "wbr"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)
        self._script = None

    def handle_data(self, data):
        if self._script is not None:
            self.scripts[self._script] += data
        elif self.open and self.open[-1] != "style":
            # Where lines may end is for the eye.
            self.words += data.replace("\N{NO-BREAK SPACE}", " ")


def document(path: Path) -> Document:
    found = Document()
    found.feed(path.read_text(encoding="utf-8"))
    found.close()
    return found


def data_of(path: Path) -> dict[str, Any]:
    """What the script of a page draws."""
    return json.loads(document(path).scripts["report-data"])
