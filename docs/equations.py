"""Turn the equations of a page into MathML while the site is built, so that a browser draws them offline.

A Python-Markdown extension, named in mkdocs.yml; it goes after pymdownx.arithmatex, which finds the equations.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.postprocessors import Postprocessor

_EQUATION = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\(?P<open>[(\[])(?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)


def _drawn(found: re.Match[str]) -> str:
    tex, block = html.unescape(found["tex"]).strip(), found["open"] == "["
    result = str(convert(tex, display="block" if block else "inline"))
    if "\\" in result:
        raise ValueError(f"an equation that cannot be drawn: {tex}")
    # A long one scrolls on a narrow screen, by the keyboard too.
    return f'<div class="equation" role="group" aria-label="Equation" tabindex="0">{result}</div>' if block else result


class _Equations(Postprocessor):
    def run(self, text: str) -> str:
        """Replace every equation of a page."""
        return _EQUATION.sub(_drawn, text)


class EquationsExtension(Extension):
    """Equations as MathML."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Come after all that puts HTML in its place."""
        md.postprocessors.register(_Equations(md), "equations", -10)


def makeExtension(**settings: Any) -> EquationsExtension:
    """Return the extension; called by Python-Markdown."""
    return EquationsExtension(**settings)
