"""Turn the equations of a page into MathML while the site is built, so that a browser draws them offline."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

_EQUATION = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\(?P<open>[(\[])(?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)


def on_page_content(content: str, *, page: Any, **_: Any) -> str:
    """Replace every equation of a page; called by MkDocs."""

    def replace(found: re.Match[str]) -> str:
        tex = html.unescape(found["tex"]).strip()
        display = "block" if found["open"] == "[" else "inline"
        result = str(convert(tex, display=display))
        if "\\" in result:
            raise PluginError(f"{page.file.src_path}: an equation that cannot be drawn: {tex}")
        return result

    return _EQUATION.sub(replace, content)
