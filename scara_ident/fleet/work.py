"""The work of a fleet, arm by arm and date by date, and its outcome."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from typing import Any

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.fleet.engine import Engine, Job, started
from scara_ident.fleet.folder import Fault, RecordingFile, content_key
from scara_ident.fleet.store import Store, key_of, reference_bytes
from scara_ident.fleet.visit import Reference, Visit, look, read_files
from scara_ident.progress import Tell
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_thread

# Threads that read files for their keys.
READERS = 4
# Share of the work that identification is; the rest is diagnosis of what changed.
IDENTIFYING = 0.8


@dataclass(frozen=True)
class Settings:
    """How a fleet is worked on.

    Attributes
    ----------
    model : str
        See `scara_ident.identify`.
    scheduler : str or None
        Address of a Dask scheduler; None: processes of this machine.
    workers : int or None
        How many of these; None: one for each core.
    diagnosed : bool
        Whether the arms that changed are diagnosed.
    """

    model: str = "complete"
    scheduler: str | None = None
    workers: int | None = None
    diagnosed: bool = True


def diagnosis_of(robot: bytes, model: str, files: Sequence[RecordingFile]) -> dict[str, Any]:
    """Return verdict and effects of one arm on one date, as JSON has them; work of a process of the fleet."""
    arm: Robot = pickle.loads(robot)
    with one_thread():
        found = diagnose(arm, read_files(arm, files)[0], model=model)
    effects = [
        {
            "effect": item.effect,
            "joint": item.joint,
            "description": item.description,
            "parameters": {name: one.entry() for name, one in item.parameters.items()},
        }
        for item in found.effects
    ]
    return {"date": files[0].date, "verdict": found.verdict, "effects": effects}


@dataclass(eq=False)
class LateEngine:
    """An engine that starts when there is work for it."""

    stack: ExitStack
    settings: Settings
    _engine: Engine | None = None

    def run(self, jobs: Iterable[Job]) -> None:
        """Do work, see `Engine.run`."""
        work = list(jobs)
        if work and self._engine is None:
            self._engine = self.stack.enter_context(started(self.settings.scheduler, self.settings.workers))
        if work and self._engine is not None:
            self._engine.run(work)


@dataclass(eq=False)
class Work:
    """What is to be done of a fleet, and what came of it."""

    robot: bytes
    settings: Settings
    store: Store
    progress: Tell
    faults: list[Fault]
    visits: dict[str, dict[str, Visit]] = field(default_factory=dict)
    diagnoses: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    keys: dict[RecordingFile, str] = field(default_factory=dict)
    total: int = 0
    done: int = 0

    def keyed(self, files: Sequence[RecordingFile]) -> list[RecordingFile]:
        """Return the files that are there, each content once."""
        with ThreadPoolExecutor(READERS) as pool:
            keys = list(pool.map(_key_or_error, files))
        first: dict[str, RecordingFile] = {}
        for file, key in zip(files, keys, strict=True):
            if isinstance(key, OSError):
                why = f"cannot be read: {(key.strerror or str(key)).lower()}"
                self.faults.append(Fault(file.arm, file.date, file.place, why, True))
            elif key in first:
                other = first[key]
                why = f"has the content of {other.arm}/{other.place}; left out, remove one of them"
                self.faults.append(Fault(file.arm, file.date, file.place, why))
            else:
                first[key] = file
                self.keys[file] = key
        return list(self.keys)

    def identify(self, by_arm: Mapping[str, Sequence[RecordingFile]], engine: LateEngine) -> None:
        """Identify every arm on every date; the first date of each says how the others are looked at."""
        dates = {
            arm: [(day, list(own)) for day, own in groupby(files, key=lambda file: file.date)]
            for arm, files in by_arm.items()
        }
        self.total = sum(map(len, dates.values()))
        engine.run(job for arm, days in dates.items() for job in self._first(arm, days))

    def _first(self, arm: str, days: Sequence[tuple[str, list[RecordingFile]]]) -> Iterator[Job]:
        """Give the work of an arm's first date; what follows it is the work of the others."""
        if not days:
            return
        (day, files), *others = days

        def then(visit: Visit | None) -> Iterator[Job]:
            if visit is None:
                yield from self._first(arm, others)
                return
            for later, own in others:
                yield from self._visit(arm, later, own, visit.reference, lambda _: ())

        yield from self._visit(arm, day, files, None, then)

    def _visit(
        self,
        arm: str,
        day: str,
        files: Sequence[RecordingFile],
        reference: Reference | None,
        then: Callable[[Visit | None], Iterable[Job]],
    ) -> Iterator[Job]:
        key = self._key("visit", files, reference_bytes(reference))
        held = self.store.visit(key)
        if held is not None:
            yield from then(self._take(arm, day, held, held.faults))
            return
        refused = self.store.content(key)
        if refused is not None:
            yield from then(self._take(arm, day, None, [Fault(**fault) for fault in refused["faults"]]))
            return
        arguments = (self.robot, self.settings.model, tuple(files), reference)
        yield Job(look, arguments, partial(self._looked, key, arm, day, then))

    def _looked(
        self, key: str, arm: str, day: str, then: Callable[[Visit | None], Iterable[Job]], outcome: Any
    ) -> Iterable[Job]:
        if isinstance(outcome, Exception):
            why = f"{arm}, {day}: its work failed: {_reason(outcome)}"
            return then(self._take(arm, day, None, [Fault(arm, day, None, why, True)]))
        visit, faults = outcome
        faults = visit.faults if visit is not None else faults
        if not any(fault.passing for fault in faults):
            if visit is not None:
                self.store.put_visit(key, visit)
            else:
                self.store.put_content(key, {"faults": [vars(fault) for fault in faults]})
        return then(self._take(arm, day, visit, faults))

    def _take(self, arm: str, day: str, visit: Visit | None, faults: Iterable[Fault]) -> Visit | None:
        self.done += 1
        self.progress("identifying", IDENTIFYING * self.done / max(1, self.total))
        self.faults += faults
        if visit is not None:
            self.visits.setdefault(arm, {})[day] = visit
        return visit

    def diagnose(
        self, latest: Mapping[str, str], by_arm: Mapping[str, Sequence[RecordingFile]], engine: LateEngine
    ) -> None:
        """Diagnose arms on their latest dates."""
        if latest:
            self.progress("diagnosing what changed", IDENTIFYING)
        engine.run(
            job
            for arm, day in latest.items()
            for job in self._diagnosis(arm, [file for file in by_arm[arm] if file.date == day])
        )

    def _diagnosis(self, arm: str, files: Sequence[RecordingFile]) -> Iterator[Job]:
        key = self._key("diagnosis", files, b"")
        held = self.store.content(key)
        if held is not None:
            self.diagnoses[arm] = held
            return

        def then(outcome: Any) -> Iterable[Job]:
            if isinstance(outcome, ScaraIdentError):
                outcome = {
                    "date": files[0].date,
                    "verdict": "none",
                    "effects": [],
                    "why": " ".join(str(outcome).split()),
                }
            if isinstance(outcome, Exception):
                why = f"{arm}, {files[0].date}: its diagnosis failed: {_reason(outcome)}"
                self.faults.append(Fault(arm, files[0].date, None, why, True))
                return ()
            self.store.put_content(key, outcome)
            self.diagnoses[arm] = outcome
            return ()

        yield Job(diagnosis_of, (self.robot, self.settings.model, tuple(files)), then)

    def _key(self, kind: str, files: Sequence[RecordingFile], more: bytes) -> str:
        from scara_ident import __version__

        # The name says which trajectory it is, and arm and date are in what is said of faults.
        contents = [part for file in files for part in (self.keys[file], file.arm, file.date, file.place)]
        return key_of(kind, __version__, self.robot, self.settings.model, *contents, more)


def _key_or_error(file: RecordingFile) -> str | OSError:
    try:
        return content_key(file.url)
    except OSError as error:
        return error


def _reason(error: Exception) -> str:
    # What is ours says what to do.
    said = str(error) if isinstance(error, ScaraIdentError) else f"{type(error).__name__}: {error}"[:200]
    return " ".join(said.split())
