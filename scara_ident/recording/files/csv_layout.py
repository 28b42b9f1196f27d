"""How a CSV file is laid out: what separates, which line names the columns, and where the rows begin.

Controllers write lines of their own before the table, a line of units behind its names, or the sign of a comment before
them; the rows tell the table from all that.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from scara_ident.errors import RecordingError
from scara_ident.recording.files.dates import is_date
from scara_ident.robot.units import BRACKETS, is_si, is_unit

# What loggers and spreadsheets write where there is no number.
MISSING = ("NA", "N/A", "n/a", "na", "null", "None", "-")
# A decimal comma stands behind a semicolon or tab alone, so that these come first.
SEPARATORS = (";", "\t", ",", " ")
# Of what begins with none of the marks below; what is no UTF-8 is mostly a controller's or spreadsheet's on Windows.
ENCODINGS = ("utf-8-sig", "cp1252")
# The byte order marks of UTF-16, which spreadsheets call Unicode text.
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
# No header is as long, nor the row of a table.
LONGEST_LINE = 1_000_000
# Lines that are looked at: more than controllers write before a table.
LOOKED_AT = 100
_IDLE_BLANKS = re.compile(rb"^ +| +(?=\r?$)| (?= )", re.MULTILINE)
_COMMENT = re.compile(r"^\s*[#%]+\s*(?=[^\s,;])")


@dataclass(frozen=True)
class CsvLayout:
    """Where the table of a CSV file stands.

    Attributes
    ----------
    separator : str
        Where it is a blank, several of them are one, and those at the ends of a line none: see `one_blank`.
    names : tuple of str
        Of the columns, without surrounding blanks, with the unit in brackets where a line of units says one that is not
        SI; ``column_3`` for the third where no line names it.
    first : int
        Lines of the file before the first row.
    cells : int
        Of a row: more than columns where rows end with a separator, as loggers write that put one behind every number.
    encoding : str
        Of the lines that were looked at, as Python calls it: ``utf-8-sig``, ``cp1252`` (Windows-1252) or ``utf-16``.
    """

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    first: int
    cells: int
    encoding: str = ENCODINGS[0]


def csv_layout(path: Path) -> CsvLayout:
    """Look at the first lines of a CSV file.

    Raises
    ------
    RecordingError
        If a line is too long to be one of a table.
    UnicodeDecodeError, csv.Error
        If it is no text, or no table.
    """
    encoding, places, lines = _decoded(path)
    if not lines:
        return CsvLayout(",", False, (), 0, 0, encoding)
    separator, rows, cells = _table(lines)
    width = cells - _empty_ends(rows, cells)
    rows = [row[:width] if len(row) == cells else row for row in rows]
    header, begin = _header(rows, width)
    if header is None:
        names = ("",) * len(rows[begin])
    else:
        units = rows[header + 1] if begin == header + 2 else [""] * len(rows[header])
        names = tuple(
            name if unit in ("", *MISSING) or is_si(unit) else f"{name} [{unit.strip(BRACKETS)}]"
            for name, unit in zip(rows[header], units, strict=True)
        )
    names = tuple(name or f"column_{k + 1}" for k, name in enumerate(names))
    if max(map(len, names)) > csv.field_size_limit():
        raise csv.Error(f"a name of more than {csv.field_size_limit()} characters")
    first = places[begin] if begin < len(places) else places[-1] + 1
    comma = separator != "," and begin < len(lines) and "," in lines[begin]
    return CsvLayout(separator, comma, names, first, len(names) + cells - width, encoding)


def one_blank(text: bytes) -> bytes:
    """Return lines whose cells are apart by blanks, as columns of fixed width are, with one between two and none at the ends."""
    if not any(mark in text for mark in (b"  ", b" \n", b" \r", b"\n ")) and text == text.strip(b" "):
        return text
    return _IDLE_BLANKS.sub(b"", text)


def _decoded(path: Path) -> tuple[str, list[int], list[str]]:
    """Return the first encoding in which the first lines are text, and them."""
    with path.open("rb") as file:
        marked = file.read(2) in UTF_16
    *others, last = ("utf-16",) if marked else ENCODINGS
    for encoding in others:
        with suppress(UnicodeDecodeError):
            return encoding, *_first_lines(path, encoding)
    places, lines = _first_lines(path, last)
    # Windows-1252 has a letter for almost every byte, also of what is no text.
    if last == ENCODINGS[-1] and any("\0" in line for line in lines):
        raise UnicodeDecodeError(last, b"\0", 0, 1, "no text")
    return last, places, lines


def _first_lines(path: Path, encoding: str) -> tuple[list[int], list[str]]:
    """Return the first lines that are not empty, without the sign of a comment, and how many stand before each."""
    places: list[int] = []
    lines: list[str] = []
    with path.open(encoding=encoding, newline="") as file:
        for place in range(LOOKED_AT):
            line = file.readline(LONGEST_LINE)
            if len(line) == LONGEST_LINE and lines:
                break
            if len(line) == LONGEST_LINE:
                raise RecordingError(
                    f"{path}: a line of more than {LONGEST_LINE} characters: not a table; save it again"
                )
            if line.strip():
                places.append(place)
                lines.append(_COMMENT.sub("", line).strip("\r\n"))
    return places, lines


def _table(lines: Sequence[str]) -> tuple[str, list[list[str]], int]:
    """Return what separates, the cells of the lines, and how many a row of the table has: the most rows of one width do."""
    best: tuple[int, str, list[list[str]], int] | None = None
    for separator in SEPARATORS:
        rows = [[cell.strip() for cell in _cells(line, separator)] for line in lines]
        # What stands before the table may have numbers too, but not as many lines.
        widths = Counter(len(row) for row in rows[len(rows) // 2 :] if len(row) > 1 and _has_number(row))
        width, count = max(widths.items(), key=lambda item: item[::-1], default=(0, 0))
        if best is None or count > best[0]:
            best = count, separator, rows, width
    assert best is not None
    if best[0]:
        return best[1:]
    # A header alone, or a table of words: blanks separate only where nothing else does.
    separator = max(SEPARATORS[:-1], key=lines[0].count)
    separator = separator if separator in lines[0] else " " if " " in lines[0].strip() else ","
    rows = [[cell.strip() for cell in _cells(line, separator)] for line in lines]
    return separator, rows, len(rows[0])


def _empty_ends(rows: Sequence[Sequence[str]], cells: int) -> int:
    """Return how many cells at the end of a row are empty in all lines of as many cells, of which some have a number."""
    full = [row for row in rows if len(row) == cells]
    last = max((k + 1 for row in full for k, cell in enumerate(row) if cell), default=cells)
    return cells - last


def _cells(line: str, separator: str) -> list[str]:
    line = one_blank(line.strip().encode()).decode() if separator == " " else line
    # A field longer than Python's parser takes is no name and no number, wherever it ends.
    whole = len(line) <= csv.field_size_limit()
    return next(csv.reader([line], delimiter=separator), []) if whole else line.split(separator)


def _header(rows: Sequence[Sequence[str]], width: int) -> tuple[int | None, int]:
    """Return the line that names the columns, or None, and that of the first row."""
    if _is_row(rows[0], width):
        return None, 0
    for place, row in enumerate(rows[:-1]):
        if len(row) != width or _has_number(row):
            continue
        units = len(rows[place + 1]) == width and _are_units(rows[place + 1])
        begin = place + 2 if units else place + 1
        if begin < len(rows) and len(rows[begin]) >= width and _has_number(rows[begin]):
            return place, begin
    begin = next((place for place, row in enumerate(rows) if _is_row(row, width)), 0)
    # Where no line can be the header the first is, whatever is wrong with it, unless it is a remark before bare rows.
    return (None, begin) if begin > 1 or (begin == 1 and len(rows[0]) == 1) else (0, 1)


def _is_row(row: Sequence[str], width: int) -> bool:
    """Tell whether a line is numbers, points in time and gaps alone, and so no header."""
    words = [word for word in row if word not in ("", *MISSING) and not _is_number(word)]
    return len(row) == width > 1 and _has_number(row) and all(map(is_date, words))


def _has_number(row: Sequence[str]) -> bool:
    return any(map(_is_number, row))


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _are_units(row: Sequence[str]) -> bool:
    words = [word for word in row if word and word not in MISSING]
    return bool(words) and all(map(is_unit, words))
