"""The code blocks of a page, run as a reader would, in order, in one folder, and what they print beside what it shows.

- ``bash`` and ``python`` are run; so are lines of a ``text`` block that begin with ``$``. Where a ``bash``
  block holds nothing but the program, its words and files for what it prints they are run in this process, which has loaded what each would load anew;
  all else is run by the shell.
- ``text`` is what the block before it prints, or these lines do, or a part of that.
- ``sh`` is only read: commands for data or places that a test does not have.
- A block with a title is a file.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scara_ident.cli.main import run as run_program
from tests.shared import PATIENCE, ROOT

PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")))

_BLOCK = re.compile(r"^```(?P<head>[^\n]*)\n(?P<text>.*?)^```[ \t]*$", re.DOTALL | re.MULTILINE)
_TITLE = re.compile(r'title="([^"]+)"')
# A command behind a prompt, with the lines that a backslash joins to it.
_PROMPTED = re.compile(r"^\$ ((?:\\\n|[^\n])*)", re.MULTILINE)
# What a shell does more with than to part words.
_SHELL = re.compile(r"[$*?~\[{|&;<()`!]")
# Not the digit of a name such as joint1 or P_d1.
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file that it is to be written to, its text, and the line where that begins."""

    language: str
    title: str | None
    text: str
    line: int

    @property
    def prompted(self) -> str:
        """Commands behind a prompt, with the lines that a backslash joins to them."""
        return "\n".join(_PROMPTED.findall(self.text))

    @property
    def shown(self) -> list[str]:
        """Lines that are shown as printed."""
        return [line for line in _PROMPTED.sub("", self.text).splitlines() if line]


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page, in order."""
    content = page.read_text(encoding="utf-8")
    found = []
    for match in _BLOCK.finditer(content):
        head = match["head"].split()
        title = _TITLE.search(match["head"])
        line = content.count("\n", 0, match.start("text")) + 1
        found.append(Block(head[0] if head else "", title and title[1], match["text"], line))
    return found


def run(page: Path, folder: Path, done: Sequence[Block] = ()) -> dict[str, Any]:
    """Run a page in a folder, which is the working directory; return the names that its Python made.

    Blocks that were run before are not run again. Fails where a block fails or prints something else than the page shows.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    printed: str | None = None
    for block in blocks(page):
        where = f"{page.relative_to(ROOT) if page.is_relative_to(ROOT) else page}, line {block.line}"
        if block in done:
            continue
        if block.title is not None:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "bash":
            printed = run_here(where, block.text, folder)
        elif block.language == "python":
            # So that a traceback names the page and its line.
            code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
            with redirect_stdout(io.StringIO()) as out:
                exec(code, names)
            printed = out.getvalue()
        elif block.language == "text":
            printed = run_bash(where, block.prompted, folder) if block.prompted else printed
            assert printed is not None, f"{where}: no block before it prints this"
            missing = not_printed(block.shown, printed)
            assert missing is None, f"{where}: {missing!r} is not printed; this is:\n{printed}"
    return names


def run_here(where: str, commands: str, folder: Path) -> str:
    """Run commands as `run_bash`, in this process where each is one of the program and a shell would only part its words."""
    lines = [shlex.split(line, comments=True) for line in commands.replace("\\\n", " ").splitlines()]
    # The last word may be a file for what is printed.
    each = [(words[:-2], words[-1:]) if words[-2:-1] == [">"] else (words, []) for words in lines if words]
    if _SHELL.search(commands) or any(words[0] != "scara-ident" or ">" in "".join(words) for words, _ in each):
        return run_bash(where, commands, folder)
    printed = ""
    for words, file in each:
        with chdir(folder), redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as told:
            status = run_program(words[1:])
        assert (status, told.getvalue()) == (0, ""), f"{where}: status {status}\n{out.getvalue()}{told.getvalue()}"
        for name in file:
            (folder / name).write_text(out.getvalue(), encoding="utf-8")
        printed += "" if file else out.getvalue()
    return printed


def run_bash(where: str, commands: str, folder: Path) -> str:
    """Run commands as one script that stops at the first that fails; return what they print."""
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    modules = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", commands], cwd=folder, capture_output=True, text=True, timeout=PATIENCE,
        env={**os.environ, "PATH": search, "PYTHONPATH": modules}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{where}: exit status {done.returncode}\n{done.stdout}{done.stderr}"
    assert "Traceback" not in done.stderr, f"{where}:\n{done.stderr}"
    return done.stdout


def not_printed(shown: list[str], printed: str) -> str | None:
    """Return the first shown line that was not printed in its place, or None.

    Lines may be left out between those shown, and wrapped elsewhere; spaces do not count.
    """
    lines = [line.split() for line in printed.splitlines()]
    words = [word for line in lines for word in line]
    starts = [sum(map(len, lines[:k])) for k in range(len(lines))]
    here = 0
    for line in shown:
        wanted = line.split()
        places = [here, *(start for start in starts if start > here)]
        fits = (
            place
            for place in places
            if len(words) >= place + len(wanted) and all(map(same, wanted, words[place : place + len(wanted)]))
        )
        found = next(fits, None)
        if found is None:
            return line
        here = found + len(wanted)
    return None


def same(shown: str, printed: str) -> bool:
    """Whether two words are the same: numbers to two digits, or to one unit in the last digit shown."""
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", printed):
        return False
    return all(map(_near, _NUMBER.findall(shown), _NUMBER.findall(printed)))


def _near(shown: str, printed: str) -> bool:
    if re.fullmatch(r"[-+]?\d+", shown):
        return shown == printed
    mantissa, _, power = shown.partition("e")
    unit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
    # Two digits: half a unit of the second is at most 5 % of the number.
    return abs(float(shown) - float(printed)) <= max(0.05 * abs(float(shown)), 1.01 * unit)


def commands_in(page: Path) -> list[list[str]]:
    """Return the words of every command line of ``scara-ident`` or ``python -m scara_ident`` in the blocks of a page."""
    found = []
    for block in blocks(page):
        if block.language in ("bash", "sh", "text"):
            text = block.prompted if block.language == "text" else block.text
            for line in text.replace("\\\n", " ").splitlines():
                words = shlex.split(line, comments=True)
                if words[:1] == ["scara-ident"]:
                    found.append(words[1:])
                elif words[:3] == ["python", "-m", "scara_ident"]:
                    found.append(words[3:])
    return found
