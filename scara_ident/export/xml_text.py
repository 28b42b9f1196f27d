"""Edits of an XML file that leave every other character of it as it is.

A parser that writes the file anew loses quotes, white space or the order of attributes, so the parser here only
tells where elements stand, and the edits are made in the text.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from scara_ident.errors import ScaraIdentError

COMMENT = "<!--"
_START_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=/>]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*/?>")
_ATTRIBUTE = re.compile(rb"\s([^\s=/>]+)\s*=\s*(\"[^\"]*\"|'[^']*')")
_ENCODING = re.compile(rb"\A(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")


@dataclass(eq=False)
class Element:
    """Where an element stands in the text, in bytes.

    ``start`` to ``opened`` is its start tag, ``opened`` to ``closing`` its content, ``closing`` to ``end`` its
    end tag; an empty tag has no content and no end tag.
    """

    tag: str
    attributes: dict[str, str]
    start: int
    opened: int
    closing: int
    end: int
    children: list[Element] = field(default_factory=list)

    def find(self, tag: str) -> Element | None:
        """Return the first child of a tag."""
        return next(self.find_all(tag), None)

    def find_all(self, tag: str) -> Iterator[Element]:
        """Yield the children of a tag."""
        return (child for child in self.children if child.tag == tag)

    def descendants(self, tag: str) -> Iterator[Element]:
        """Yield the elements of a tag at any depth below."""
        for child in self.children:
            if child.tag == tag:
                yield child
            yield from child.descendants(tag)


@dataclass(frozen=True)
class Edit:
    """Replace the bytes from ``start`` to ``end``."""

    start: int
    end: int
    new: bytes


def read_xml(path: Path) -> tuple[bytes, bool]:
    """Read an XML file as UTF-8.

    Returns
    -------
    content : bytes
        The text as UTF-8, byte by byte the file where that is its encoding.
    converted : bool
        Whether the file was in another encoding; then its declaration has been changed to UTF-8.

    Raises
    ------
    ScaraIdentError
        If it cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ScaraIdentError(f"{path}: cannot be read: {error.strerror}") from None
    declared = _ENCODING.match(content)
    encoding = declared.group(1).decode() if declared else "utf-8"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    try:
        text = content.decode(encoding)
    except (UnicodeDecodeError, LookupError):
        raise ScaraIdentError(f"{path}: is not text in its encoding, {encoding}") from None
    new = text.encode("utf-8")
    declared = _ENCODING.match(new)
    if declared is None or new == content:
        return new, new != content
    start, end = declared.span(1)
    return new[:start] + b"utf-8" + new[end:], True


def parse(content: bytes, path: Path) -> Element:
    """Find the elements and comments of an XML text; ``path`` is named in errors."""
    parser = expat.ParserCreate("utf-8")
    top = Element("", {}, 0, 0, len(content), len(content))
    stack = [top]

    def begin(tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        match = _START_TAG.match(content, start)
        if match is None:
            raise ScaraIdentError(f"{path}, line {parser.CurrentLineNumber}: cannot follow the element <{tag}>")
        element = Element(tag, attributes, start, match.end(), match.end(), match.end())
        stack[-1].children.append(element)
        stack.append(element)

    def finish(_: str) -> None:
        element = stack.pop()
        if not _is_empty_tag(content, element):
            element.closing = parser.CurrentByteIndex
            element.end = content.index(b">", element.closing) + 1

    def comment(_: str) -> None:
        start = parser.CurrentByteIndex
        end = content.index(b"-->", start) + 3
        stack[-1].children.append(Element(COMMENT, {}, start, start + 4, end - 3, end))

    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    parser.CommentHandler = comment
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise ScaraIdentError(f"{path}: not well-formed XML: {error}") from None
    return next(child for child in top.children if child.tag != COMMENT)


def set_numbers(content: bytes, element: Element, values: Mapping[str, Sequence[float]]) -> list[Edit]:
    """Set attributes to numbers; one that has the number already keeps its spelling, a missing one is appended."""
    edits: list[Edit] = []
    spans = {match.group(1).decode(): match.span(2) for match in _attributes(content, element)}
    for name, numbers in values.items():
        new = format_numbers(numbers)
        if name not in spans:
            place = element.opened - (2 if _is_empty_tag(content, element) else 1)
            place = len(content[:place].rstrip())
            edits.append(Edit(place, place, f' {name}="{new}"'.encode()))
        elif not same_numbers(element.attributes[name], numbers):
            start, end = spans[name]
            edits.append(Edit(start + 1, end - 1, new.encode()))
    return edits


def _attributes(content: bytes, element: Element) -> Iterator[re.Match[bytes]]:
    return _ATTRIBUTE.finditer(content, element.start, element.opened)


def format_numbers(numbers: Sequence[float]) -> str:
    """Write numbers so that they read back as they are; adding 0 turns -0.0 into 0.0."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)


def same_numbers(text: str, numbers: Sequence[float]) -> bool:
    """Return whether a text holds these numbers."""
    try:
        return [float(part) for part in text.split()] == [float(number) for number in numbers]
    except ValueError:
        return False


def blank_before(content: bytes, element: Element) -> bytes:
    """Return the white space before an element."""
    start = element.start
    while start > 0 and content[start - 1 : start].isspace():
        start -= 1
    return content[start : element.start]


def removal(content: bytes, element: Element) -> Edit:
    """Remove an element with the white space before it."""
    return Edit(element.start - len(blank_before(content, element)), element.end, b"")


def _separator(content: bytes, element: Element) -> bytes:
    """Return what parts an element from the one before: a line break and its indentation, or what there is."""
    blank = blank_before(content, element)
    at = blank.rfind(b"\n")
    if at < 0:
        return blank
    return blank[at - 1 :] if blank[at - 1 : at] == b"\r" else blank[at:]


def append_child(content: bytes, parent: Element, child: str) -> Edit:
    """Add a child behind the others of an element that has some, laid out as they are."""
    last = parent.children[-1]
    laid_out = [other for other in parent.children if other.tag != COMMENT] or [last]
    return Edit(last.end, last.end, _separator(content, laid_out[-1]) + child.encode())


def prepend_child(content: bytes, parent: Element, lines: Sequence[str]) -> Edit:
    """Add a child before the others of an element, laid out as they are; a leading tab is one step in."""
    outer = _separator(content, parent)
    step = b"\t" if outer.endswith(b"\t") else b"  "
    inner = _separator(content, parent.children[0]) if parent.children else outer + step
    if b"\n" not in inner:  # all on one line
        inner = outer = step = b""
    block = b"".join(inner + line.encode().replace(b"\t", step) for line in lines)
    if not _is_empty_tag(content, parent):
        return Edit(parent.opened, parent.opened, block)
    start = len(content[: parent.opened - 2].rstrip())
    return Edit(start, parent.opened, b">" + block + outer + f"</{parent.tag}>".encode())


def _is_empty_tag(content: bytes, element: Element) -> bool:
    return content[element.opened - 2 : element.opened] == b"/>"


def apply(content: bytes, edits: Sequence[Edit]) -> bytes:
    """Return the text with all edits made; those at one place in the order given."""
    pieces: list[bytes] = []
    at = 0
    for edit in sorted(edits, key=lambda item: item.start):
        if edit.start < at:
            raise ValueError("edits overlap")
        pieces += [content[at : edit.start], edit.new]
        at = edit.end
    return b"".join([*pieces, content[at:]])
