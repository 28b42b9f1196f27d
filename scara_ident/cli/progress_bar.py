"""The bar of long work on a terminal: the step, a percentage and the time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

from scara_ident.progress import Tell

# Before so much is done, and so many seconds have gone, how long the rest takes is not said.
MIN_SHARE, MIN_SECONDS = 0.02, 2.0


class TimeLeft:
    """How long the rest takes if it goes on as fast as all before.

    Parameters
    ----------
    clock : callable, optional
        Gives seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start = clock()
        self._done = 0.0
        self._end: float | None = None

    def tell(self, done: float) -> float:
        """Take the share that is done, and return it, or an earlier one that was larger."""
        if done > self._done:
            self._done = min(done, 1.0)
            gone = self._clock() - self._start
            if self._done >= MIN_SHARE and gone >= MIN_SECONDS:
                self._end = self._start + gone / self._done
        return self._done

    def words(self) -> str:
        """Return the time left in words; nothing where it is not known or a step takes longer than it should."""
        left = -1.0 if self._end is None else self._end - self._clock()
        if left <= 0.0:
            return ""
        minutes, seconds = divmod(max(1, round(left)), 60)
        hours, minutes = divmod(minutes, 60)
        if hours:
            return f"{hours} h {minutes} min left"
        return f"{minutes} min {seconds} s left" if minutes else f"{seconds} s left"


class TimeLeftColumn(ProgressColumn):
    """The time left, anew at every drawing."""

    def __init__(self, left: TimeLeft) -> None:
        super().__init__()
        self._left = left

    def render(self, task: Task) -> Text:
        """Return the words."""
        return Text(self._left.words(), style="progress.remaining")


@contextmanager
def shown(console: Console) -> Iterator[Tell]:
    """Show a bar on a terminal as long as the work takes."""
    left = TimeLeft()
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=20),
        TextColumn("{task.percentage:3.0f}%"),
        TimeLeftColumn(left),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)

        def tell(step: str, done: float) -> None:
            bar.update(task, description=step, completed=left.tell(done), refresh=True)

        yield tell
