"""Progress of long work: the step that runs, the share that is done, and what was found so far."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from logging import Logger

Tell = Callable[[str, float], None]
"""Takes the step that begins and the share of all work that is done before it, from 0 to 1."""


def silent(step: str, done: float) -> None:
    """Tell nobody."""


def log_notes(logger: Logger, notes: Iterable[str]) -> None:
    """Log what there is to know of the data or the result; the result holds it too, and the command prints it."""
    for note in notes:
        logger.warning("%s", note)


@dataclass(frozen=True)
class Work:
    """A part of some work, from one share of the whole to another.

    How many steps a search takes is not known before. Shares are those that usual work takes; a search that finds more
    has longer steps at its end, and no share is ever smaller than one before.

    Attributes
    ----------
    start, stop : float
        Shares of the whole, 0 to 1.
    """

    tell: Tell = silent
    start: float = 0.0
    stop: float = 1.0

    def __call__(self, step: str, done: float = 0.0) -> None:
        """Tell that a step begins after a share of this part."""
        self.tell(step, self.start + done * (self.stop - self.start))

    def part(self, start: float, stop: float) -> Work:
        """Return a part of this part, by shares of it."""
        width = self.stop - self.start
        return Work(self.tell, self.start + start * width, self.start + stop * width)
