"""From a folder of recordings to what changed in which arm."""

from __future__ import annotations

import pickle
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from scara_ident.fleet.changes import (
    FALSE_CHANGE_LEVEL,
    FEWEST_STEPS,
    Change,
    arms_counted,
    find_changes,
    grown_residuals,
    min_probability,
    residual_scatter,
    trials_of,
)
from scara_ident.fleet.folder import Fault, date_notes, list_fleet
from scara_ident.fleet.history import History
from scara_ident.fleet.odd import Oddity, odd_arms
from scara_ident.fleet.scatter import fleet_scatter
from scara_ident.fleet.store import FOLDER, Store
from scara_ident.fleet.table import Quantity, quantities
from scara_ident.fleet.words import sentences
from scara_ident.fleet.work import IDENTIFYING, LateEngine, Settings, Work
from scara_ident.manners import several
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.progress import Tell, silent
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_thread

# Of an arm so many parameters are said that are unlike others': one that is off in all of them is named by the farthest.
MAX_ODD = 3


@dataclass(frozen=True, eq=False)
class ArmReport:
    """What was found of one arm.

    Attributes
    ----------
    arm : str
    history : History or None
        None where no recording could be used.
    changes : tuple of Change
        The surest first.
    diagnosis : mapping or None
        Verdict and effects of the latest date of an arm that changed.
    faults : tuple of Fault
    determined : bool
        Whether the fleet has dates enough to tell a change from what differs by nature.
    odd : tuple of Oddity
        Parameters that are far from those of the other arms on its first date, the farthest first.
    """

    arm: str
    history: History | None
    changes: tuple[Change, ...] = ()
    diagnosis: Mapping[str, Any] | None = None
    faults: tuple[Fault, ...] = ()
    determined: bool = True
    odd: tuple[Oddity, ...] = ()

    @property
    def known(self) -> History:
        """The history of an arm that has one."""
        if self.history is None:
            raise ValueError(f"{self.arm} has no date")
        return self.history

    @property
    def verdict(self) -> str:
        """``changed``, ``unchanged``, ``undecided``, ``one date`` or ``no data``."""
        if self.history is None:
            return "no data"
        if len(self.history.dates) < 2:
            return "one date"
        if self.changes:
            return "changed"
        return "unchanged" if self.determined else "undecided"

    @property
    def sentences(self) -> tuple[str, ...]:
        """What changed, in words, a sentence for each cause."""
        return sentences(self.changes, self.known.scene) if self.changes else ()

    @property
    def oddities(self) -> tuple[str, ...]:
        """What is unlike other arms on its first date, in words; of many parameters the farthest."""
        more = len(self.odd) - MAX_ODD
        said = tuple(f"On its first date {item.words}" for item in self.odd[:MAX_ODD])
        return (*said, f"So are {several(more, 'more parameter')}") if more > 0 else said


@dataclass(frozen=True, eq=False)
class Fleet:
    """What was found of a fleet.

    Attributes
    ----------
    robot : Robot
    model : TorqueModel
    arms : tuple of ArmReport
        By name.
    quantities : mapping of str to tuple
        By arm, for each date its quantities.
    notes : tuple of str
        What to know of the dates.
    """

    robot: Robot
    model: TorqueModel
    arms: tuple[ArmReport, ...]
    quantities: Mapping[str, tuple[tuple[Quantity, ...], ...]]
    notes: tuple[str, ...] = ()

    @property
    def ranked(self) -> tuple[ArmReport, ...]:
        """The arms by their need of a look: the surest change first, then what is unlike others, then faults, then the rest by name."""

        def need(item: ArmReport) -> tuple[object, ...]:
            return not item.changes, -_surest(item), -_farthest(item), not item.faults, item.arm

        return tuple(sorted(self.arms, key=need))

    @property
    def reservation(self) -> str | None:
        """Why nothing can be said of arms that are undecided, and what would tell."""
        few = [item for item in self.arms if item.verdict == "undecided"]
        if not few:
            return None
        steps = _steps(item.history for item in self.arms if item.history is not None)
        return (
            f"{several(steps, 'difference')} between dates of the whole fleet are too few to distinguish a change from "
            f"the normal differences from day to day: {FEWEST_STEPS} are needed, from more dates or more arms"
        )

    @property
    def faults(self) -> tuple[Fault, ...]:
        """All faults, by arm."""
        return tuple(fault for item in self.arms for fault in item.faults)


def watch_fleet(
    folder: str, robot: Robot, output: Path, settings: Settings | None = None, progress: Tell = silent
) -> Fleet:
    """Identify all arms of a fleet on all dates, and find what changed.

    What is done is held in ``output`` under keys of the recordings' content: a later run goes on from there. Processes
    of this machine are started anew, so a script calls this under ``if __name__ == "__main__"``.

    Parameters
    ----------
    folder : str
        A path, or an address that fsspec knows, with a sub-folder for each arm; see `list_fleet`.
    robot : Robot
        Of all arms.
    output : Path
    settings : Settings, optional
    progress : callable, optional
        Called with every step that begins and the share of the work done before it.

    Returns
    -------
    Fleet
        What could not be used is in its faults; all else is complete.

    Raises
    ------
    UsageError
        If there is no such folder, Dask is not installed or no scheduler answers.
    RecordingError
        If the folder has no sub-folder.
    """
    settings = settings or Settings()
    progress("listing the recordings", 0.0)
    files, faults = list_fleet(folder)
    work = Work(pickle.dumps(robot), settings, Store(output / FOLDER), progress, list(faults))
    kept = work.keyed(files)
    by_arm = {arm: list(own) for arm, own in groupby(kept, key=lambda file: file.arm)}
    with ExitStack() as stack:
        engine = LateEngine(stack, settings)
        work.identify(by_arm, engine)
        model = build_model(robot, settings.model)
        histories = {
            arm: History(arm, tuple(sorted(dates)), tuple(dates[key] for key in sorted(dates)), model)
            # In an order of their own, not in which they were done: sums are then the same to the last digit.
            for arm, dates in sorted(work.visits.items())
        }
        progress("comparing the dates", IDENTIFYING)
        changes = changes_of(list(histories.values()))
        if settings.diagnosed:
            work.diagnose({arm: histories[arm].dates[-1] for arm, found in changes.items() if found}, by_arm, engine)
    arms = sorted({*by_arm, *(fault.arm for fault in work.faults)})
    determined = _steps(histories.values()) >= FEWEST_STEPS
    told = quantities(list(histories.values()))
    odd = odd_arms(model, {arm: dates[0] for arm, dates in told.items()})
    reports = tuple(
        ArmReport(
            arm,
            histories.get(arm),
            changes.get(arm, ()),
            work.diagnoses.get(arm),
            tuple(sorted((item for item in work.faults if item.arm == arm), key=str)),
            determined,
            odd.get(arm, ()),
        )
        for arm in arms
    )
    return Fleet(robot, model, reports, told, date_notes(files))


def changes_of(histories: Sequence[History]) -> dict[str, tuple[Change, ...]]:
    """Return by arm what changed; arms with one date are left out.

    Parameters
    ----------
    histories : sequence of History
        Of one robot and model.
    """
    compared = [item for item in histories if len(item.dates) > 1]
    if not compared:
        return {}
    with one_thread():
        scatter = fleet_scatter(compared)
        # Arms with as many dates are tried as often.
        trials = {len(item.dates): item for item in compared}
        tried = {count: trials_of(item, scatter) for count, item in trials.items()}
        least = [min_probability(item, scatter, tried[len(item.dates)]) for item in compared]
        arms, residuals = arms_counted(least), residual_scatter(compared)
        found = {}
        for item, probability in zip(compared, least, strict=True):
            own = tried[len(item.dates)]
            # Of most arms the surest change is none, and no more is asked.
            named = find_changes(item, scatter, own * arms) if probability * arms < FALSE_CHANGE_LEVEL else ()
            found[item.arm] = named or grown_residuals(item, *residuals, own * len(compared))
        return found


def _steps(histories: Iterable[History]) -> int:
    """Return how many differences between neighbouring dates there are."""
    return sum(len(item.dates) - 1 for item in histories)


def _farthest(report: ArmReport) -> float:
    return max((abs(item.stds) for item in report.odd), default=0.0)


def _surest(report: ArmReport) -> float:
    return max((change.score for change in report.changes), default=0.0)
