"""Edits of XML text: what is edited reads back, and no other byte changes."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.errors import ScaraIdentError
from scara_ident.export.xml_text import (
    COMMENT,
    Edit,
    append_child,
    apply,
    format_numbers,
    parse,
    prepend_child,
    read_xml,
    removal,
    same_numbers,
    set_numbers,
)

PATH = Path("arm.xml")
TEXT = b"""<?xml version='1.0'?>
<!-- before -->
<robot name="a>b">
\t<link  name = 'arm' ><mass value='1e0'
\t\t unit="kg"/></link>
\t<!-- <link name="no"/> -->
\t<link name="bare"/>
</robot>
"""
FINITE = st.floats(allow_nan=False, allow_infinity=False)


@given(numbers=st.lists(FINITE, max_size=4))
def test_numbers_read_back_as_they_are(numbers: list[float]):
    text = format_numbers(numbers)
    assert [float(part) for part in text.split()] == numbers
    assert "-0.0" not in text.split()
    assert same_numbers(text, numbers)
    assert not same_numbers(f"{text} 1.0", numbers)


@given(value=FINITE, more=FINITE)
def test_a_number_that_is_set_reads_back_and_nothing_else_changes(value: float, more: float):
    mass = next(parse(TEXT, PATH).descendants("mass"))
    changed = apply(TEXT, set_numbers(TEXT, mass, {"value": [value], "more": [more]}))
    found = next(ElementTree.fromstring(changed).iter("mass")).attrib
    assert (float(found["value"]), float(found["more"]), found["unit"]) == (value, more, "kg")
    old = b"'1e0'" if value != 1.0 else b"absent"
    assert changed.replace(f'"kg" more="{more + 0.0!r}"'.encode(), b'"kg"').replace(f"'{value + 0.0!r}'".encode(), old) in (
        TEXT, TEXT.replace(b"'1e0'", old),
    )  # fmt: skip


def test_a_number_that_is_there_keeps_its_spelling():
    mass = next(parse(TEXT, PATH).descendants("mass"))
    assert apply(TEXT, set_numbers(TEXT, mass, {"value": [1.0]})) == TEXT


def test_elements_are_found_where_they_stand_and_not_in_comments():
    root = parse(TEXT, PATH)
    assert [child.tag for child in root.children] == ["link", COMMENT, "link"]
    assert [link.attributes["name"] for link in root.find_all("link")] == ["arm", "bare"]
    bare = list(root.find_all("link"))[1]
    assert TEXT[bare.start : bare.end] == b'<link name="bare"/>'
    assert TEXT[root.opened : root.closing].strip().startswith(b"<link  name")
    assert bare.find("mass") is None


def test_children_are_added_and_taken_laid_out_like_their_neighbours():
    root = parse(TEXT, PATH)
    arm, bare = root.find_all("link")
    assert apply(TEXT, [append_child(TEXT, root, "<tool/>")]) == TEXT.replace(b'"bare"/>', b'"bare"/>\n\t<tool/>')
    inside = apply(TEXT, [prepend_child(TEXT, bare, ["<a>", "\t<b/>", "</a>"])])
    assert inside == TEXT.replace(b'"bare"/>', b'"bare">\n\t\t<a>\n\t\t\t<b/>\n\t\t</a>\n\t</link>')
    assert apply(TEXT, [removal(TEXT, bare)]) == TEXT.replace(b'\n\t<link name="bare"/>', b"")
    on_one_line = apply(TEXT, [prepend_child(TEXT, arm, ["<a/>"])])
    assert [child.tag for child in parse(on_one_line, PATH).find("link").children] == ["a", "mass"]


@given(data=st.data(), text=st.binary(max_size=20))
def test_edits_in_any_order_replace_their_places(data: st.DataObject, text: bytes):
    cuts = (
        sorted(data.draw(st.lists(st.integers(0, len(text)), min_size=4, max_size=4, unique=True)))
        if len(text) > 2
        else []
    )
    edits = [Edit(cuts[0], cuts[1], b"<1>"), Edit(cuts[2], cuts[3], b"<2>")] if cuts else []
    expected = text[: cuts[0]] + b"<1>" + text[cuts[1] : cuts[2]] + b"<2>" + text[cuts[3] :] if cuts else text
    assert apply(text, data.draw(st.permutations(edits))) == expected


def test_edits_that_overlap_are_refused():
    with pytest.raises(ValueError, match="overlap"):
        apply(b"abcdef", [Edit(0, 3, b""), Edit(2, 4, b"")])


@pytest.mark.parametrize("content", [b"<a><b></a>", b"", b"<a/><b/>", b"<a b=1/>"])
def test_what_is_no_xml_is_one_line(content: bytes):
    with pytest.raises(ScaraIdentError, match=r"^arm\.xml: not well-formed XML"):
        parse(content, PATH)


def test_other_encodings_become_utf8_and_a_false_declaration_is_reported(tmp_path: Path):
    path = tmp_path / "arm.xml"
    text = '<?xml version="1.0" encoding="ISO-8859-1"?><robot name="Fuß"/>'
    path.write_bytes(text.encode("latin-1"))
    content, converted = read_xml(path)
    assert converted
    assert parse(content, path).attributes["name"] == "Fuß"
    assert b"ISO" not in content
    path.write_bytes(text.replace("ISO-8859-1", "utf-8").encode("latin-1"))
    with pytest.raises(ScaraIdentError, match="is not text in its encoding, utf-8"):
        read_xml(path)
    path.write_bytes(TEXT)
    assert read_xml(path) == (TEXT, False)
