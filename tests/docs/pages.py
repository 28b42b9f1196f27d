"""The code blocks of a page, and running them as a reader would: in order, in one folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.shared import PATIENCE, ROOT

PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))

_BLOCK = re.compile(r"^```(?P<head>[^\n]*)\n(?P<text>.*?)^```[ \t]*$", re.DOTALL | re.MULTILINE)
_TITLE = re.compile(r'title="([^"]+)"')


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file that it is to be written to, its text, and the line where that begins."""

    language: str
    title: str | None
    text: str
    line: int

    @property
    def commands(self) -> str:
        """Commands of a bash block; where some stand behind a prompt, the other lines are what they print."""
        prompted = [line[2:] for line in self.text.splitlines() if line.startswith("$ ")]
        return "\n".join(prompted) if prompted else self.text


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


def run(page: Path, folder: Path) -> dict[str, Any]:
    """Run a page in a folder, which is the working directory; return the names that its Python made."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page):
        if block.title is not None:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "bash":
            run_bash(page, block, folder)
        elif block.language == "python":
            # So that a traceback names the page and its line.
            code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
            exec(code, names)
    return names


def run_bash(page: Path, block: Block, folder: Path) -> None:
    """Run a bash block as one script that stops at the first command that fails."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.commands],
        cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    where = f"{page.relative_to(ROOT)}, line {block.line}"
    assert done.returncode == 0, f"{where}: exit status {done.returncode}\n{done.stdout}{done.stderr}"
    assert "Traceback" not in done.stderr, f"{where}:\n{done.stderr}"
