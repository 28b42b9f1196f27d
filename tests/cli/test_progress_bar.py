"""The bar: what it says on a terminal, and how long the rest takes."""

from __future__ import annotations

import io

from rich.console import Console

from scara_ident.cli.progress_bar import TimeLeft, shown


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_time_left_is_by_the_share_done_and_counts_down():
    clock = Clock()
    left = TimeLeft(clock)
    assert left.words() == ""
    clock.now += 30.0
    assert left.tell(0.2) == 0.2
    assert left.words() == "2 min 0 s left"
    clock.now += 15.0
    assert left.words() == "1 min 45 s left"
    clock.now += 90.0
    assert left.words() == "15 s left"
    # A step that takes longer than it should: nothing is known.
    clock.now += 20.0
    assert left.words() == ""
    left.tell(0.5)
    assert left.words() == "2 min 35 s left"
    clock.now += 9845.0
    left.tell(0.51)
    assert left.words() == "2 h 40 min left"


def test_a_share_never_falls_and_early_guesses_are_not_said():
    clock = Clock()
    left = TimeLeft(clock)
    clock.now += 0.5
    left.tell(0.3)
    assert left.words() == ""
    assert left.tell(0.1) == 0.3
    assert left.tell(2.0) == 1.0


def test_a_terminal_shows_step_and_percentage_and_is_left_clean():
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100, color_system=None)
    with shown(console) as tell:
        tell("trying 275 candidates [bold]", 0.42)
    text = stream.getvalue()
    assert "trying 275 candidates [bold]" in text
    assert "42%" in text
    # The line is erased at the end.
    assert text.endswith("\x1b[2K")
