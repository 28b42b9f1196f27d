"""The loop of measuring and asking, kept in a folder: the recordings so far, what they determine, and the motion to record next.

Every step is written whole before the note that it is done, and a step depends on what lies in the folder alone. So a run
that is stopped at any moment is gone on with by the next, and one that finds nothing new changes nothing.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from scara_ident.diagnosis import diagnose
from scara_ident.errors import ScaraIdentError
from scara_ident.excitation.design import Design, design_excitation
from scara_ident.excitation.known import read_diagnosis, read_parameters
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.output import excitation_dict, write_joint_trajectory, write_trajectory
from scara_ident.excitation.promise import SURE_STANDARD_ERRORS, ExpectedAnswer
from scara_ident.excitation.search import Effort, Progress
from scara_ident.files import write_json, written_together
from scara_ident.inquiry.answerability import Inquiry, inquiry_of
from scara_ident.inquiry.questions import Question
from scara_ident.model.model import build_model
from scara_ident.progress import Work
from scara_ident.recording.apart import read_usable
from scara_ident.recording.files.parquet_csv import SUFFIXES
from scara_ident.report.html.diagnosis import DiagnosisContext, diagnosis_report
from scara_ident.robot.robot import Robot

State = Literal["record", "settled", "unanswered"]
# A motion is worth recording if it brings the answers so many times further apart than they are.
WORTHWHILE_RATIO = 1.5
# A motion is advised that lasts up to so many times as long as the one that was designed; beyond, nobody would record it.
MAX_TIMES_LONGER = 10.0
# How often recordings are asked for to answer one question, and to lower what they hardly show.
MAX_REQUESTS, MAX_LIMIT_REQUESTS = 2, 1
NOTE = "ask.json"
FILES = ("trajectory.csv", "trajectory.yaml", "excitation.json")
UNFINISHED = ".scara-ident-*"


@dataclass(frozen=True)
class Asked:
    """How far the loop is.

    Attributes
    ----------
    inputs : str
        Hash of the recordings and of how they are diagnosed.
    state : {"record", "settled", "unanswered"} or None
        Whether a motion waits to be recorded, nothing is open, or no motion within the limits would tell; None where
        ``diagnosis.json`` is of these recordings and that is still to be found.
    words : str
        The same for a person.
    asked : tuple of str
        Questions that the motion is to answer.
    times : mapping of str to int
        How often each question was asked before.
    recorded : str
        Hash of the recordings alone: what was asked counts once something new is there, not where limits are others.
    left_out : tuple of str
        Recordings that cannot be used, and why.
    """

    inputs: str
    state: State | None = None
    words: str = ""
    asked: tuple[str, ...] = ()
    times: Mapping[str, int] = field(default_factory=dict)
    recorded: str = ""
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Settings:
    """How a folder is asked.

    Attributes
    ----------
    robot : Robot
    model : str
        The base model.
    duration : float
        Of an asked motion, s.
    effort : Effort
    limits : Limits, optional
        Of the motions; by default those of `limits_of`.
    """

    robot: Robot
    model: str = "complete"
    duration: float = 15.0
    effort: Effort = field(default_factory=Effort)
    limits: Limits | None = None

    def hash(self, recordings: Sequence[Path]) -> str:
        """Return a hash of recordings, by name and content, and of what the answer depends on."""
        urdf = hashlib.sha256(self.robot.urdf.read_bytes()).hexdigest()
        words = [
            self.robot.name,
            urdf,
            self.robot.joints,
            self.model,
            self.duration,
            self.effort.starts,
            self.effort.seed,
            "" if self.limits is None else self.limits.words(),
        ]
        return hashlib.sha256(f"{words!r} {hash_of(recordings)}".encode()).hexdigest()


def hash_of(recordings: Sequence[Path]) -> str:
    """Return a hash of recordings, by name and content."""
    found = hashlib.sha256()
    for path in recordings:
        found.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def ask(folder: Path, settings: Settings, work: Work | None = None) -> Asked:
    """Go one step on: diagnose the recordings if they are new, and design the motion to record next.

    Parameters
    ----------
    folder : Path
        With ``recordings``; gets ``diagnosis.json``, ``report.html``, ``next`` and ``ask.json``.
    settings : Settings
    work : Work, optional
        Called with every step that begins.

    Returns
    -------
    Asked

    Raises
    ------
    ScaraIdentError
        If the folder's note is none, or as `diagnose` and `design_excitation` do.
    """
    work = work or Work()
    for place in (folder, folder / "next"):
        for left in place.glob(UNFINISHED):
            shutil.rmtree(left, ignore_errors=True)
    recordings = recordings_in(folder)
    inputs = settings.hash(recordings)
    before = read_asked(folder)
    if before is not None and before.inputs == inputs and _complete(folder, before):
        return before
    if before is None or before.inputs != inputs or not recordings:
        times = dict(before.times) if before is not None else {}
        recorded = hash_of(recordings)
        for question in before.asked if before is not None and before.recorded != recorded else ():
            times[question] = times.get(question, 0) + 1
        fresh = Asked(inputs, times=times, recorded=recorded)
        if not recordings:
            return _first(folder, settings, fresh, work)
        before = replace(fresh, left_out=_diagnosed(folder, settings, recordings, work.part(0.0, 0.6)))
        _note(folder, before)
    work("designing the next motion", 0.6)
    return _designed(folder, settings, recordings, before, work.part(0.6, 1.0))


def _complete(folder: Path, asked: Asked) -> bool:
    """Whether a step is done and what it wrote still lies there."""
    waits = asked.state == "record"
    return asked.state is not None and (not waits or all((folder / "next" / name).is_file() for name in FILES))


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings that lie in a folder, by name; the truth of virtual ones is none."""
    place = folder / "recordings"
    return sorted(path for path in place.glob("*") if not path.name.startswith(".") and path.suffix != ".json")


def beside_recordings(folder: Path) -> list[Path]:
    """Return tables that lie in a folder itself, where no recording is looked for."""
    return sorted(path for path in folder.glob("*") if path.suffix.lower() in SUFFIXES and path.is_file())


def progress_in_words(folder: Path) -> str:
    """Return in a line what the diagnosis of the recordings that lie in a folder came to.

    Raises
    ------
    ScaraIdentError
        If the folder's diagnosis cannot be read.
    """
    content = read_diagnosis(folder / "diagnosis.json")
    found = [
        f"{item['effect']} on {item['joint']}" if item["joint"] else item["effect"]
        for item in content.get("effects", ())
    ]
    said = f"found {', '.join(found)}" if found else "no effect found"
    return f"So far: {content['verdict']}, {said}; the full report is {folder / 'report.html'}."


def read_asked(folder: Path) -> Asked | None:
    """Return how far a folder is; None where nothing was asked.

    Raises
    ------
    ScaraIdentError
        If its note is not one.
    """
    path = folder / NOTE
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        lists = {name: tuple(content.get(name, ())) for name in ("asked", "left_out")}
        return Asked(**{**content, **lists})
    except (ValueError, TypeError, AttributeError):
        raise ScaraIdentError(f"{path}: not a file that ask wrote; remove it to begin again") from None


def _note(folder: Path, asked: Asked) -> Asked:
    write_json(folder / NOTE, vars(asked))
    return asked


def _first(folder: Path, settings: Settings, asked: Asked, work: Work) -> Asked:
    """Ask for a motion that tells much of everything, where nothing was recorded."""
    model = build_model(settings.robot, settings.model)
    design = design_excitation(
        model, duration=settings.duration, limits=settings.limits, effort=settings.effort, progress=_on_progress(work)
    )
    words = "There are no recordings yet: record next/trajectory.csv twice into recordings/."
    _written(folder, design)
    return _note(folder, replace(asked, state="record", words=words))


def _diagnosed(folder: Path, settings: Settings, recordings: Sequence[Path], work: Work) -> tuple[str, ...]:
    """Diagnose what is recorded, and return what of it cannot be used."""
    read, useless = read_usable(recordings, settings.robot)
    found = diagnose(settings.robot, read, model=settings.model, progress=work)
    context = DiagnosisContext(found)
    content = context.content
    with written_together(folder) as place:
        diagnosis_report(place / "report.html", context)
        write_json(place / "diagnosis.json", {**content, "notes": [*useless, *content["notes"]]})
    return tuple(useless)


def _designed(folder: Path, settings: Settings, recordings: Sequence[Path], asked: Asked, work: Work) -> Asked:
    content = read_diagnosis(folder / "diagnosis.json")
    read, _ = read_usable(recordings, settings.robot)
    inquiry = inquiry_of(content, settings.robot, read)
    left = still_open(inquiry, content["verdict"], asked.times)
    if not left:
        _removed(folder)
        tired = [item.text for item in inquiry.questions if asked.times.get(key_of(item), 0) >= MAX_REQUESTS]
        words = f"Asked {MAX_REQUESTS} times without an answer: {'; '.join(tired)}." if tired else "Nothing is open."
        return _note(folder, replace(asked, state="unanswered" if tired else "settled", words=words))
    inquiry = inquiry_of({**content, "next": [item.entry() for item in left]}, settings.robot, read)
    design = design_excitation(
        inquiry.scene.model,
        duration=settings.duration,
        tell=inquiry,
        known=read_parameters(folder / "diagnosis.json", inquiry.scene.model),
        limits=settings.limits,
        effort=settings.effort,
        progress=_on_progress(work),
    )
    worthwhile = worth_recording(design.tells)
    if not worthwhile:
        _removed(folder)
        return _note(
            folder, replace(asked, state="unanswered", words=unanswered_words(design.tells, settings.duration))
        )
    _written(folder, design)
    write_json(folder / "diagnosis.json", _promised(content, design.tells))
    words = (
        f"Record next/trajectory.csv into recordings/. It answers the question: {worthwhile[0].question.text}; "
        f"{worthwhile[0].before:.2g} standard errors apart so far, {worthwhile[0].after:.2g} expected with it."
    )
    keys = tuple(dict.fromkeys(key_of(item.question) for item in worthwhile))
    return _note(folder, replace(asked, state="record", words=words, asked=keys))


def _on_progress(work: Work) -> Callable[[Progress], None]:
    """Tell of every search of a design."""
    work("designing: search 1")
    return lambda state: work(f"designing: search {state.done} of {state.total} done", state.done / state.total)


def key_of(question: Question) -> str:
    """Return what a question is counted by: its words, or its kind where the words change with every recording."""
    return question.kind if _general(question) else question.text


def _general(question: Question) -> bool:
    return question.kind == "parameter" or (question.kind == "below_limit" and len(question.suspects) > 1)


def still_open(inquiry: Inquiry, verdict: str, times: Mapping[str, int]) -> list[Question]:
    """Return the questions to ask: those not asked too often; what the recordings hardly show is asked for once.

    Parameters
    ----------
    inquiry : Inquiry
    verdict : str
        Of the diagnosis; an undecided one asks for more.
    times : mapping of str to int
        How often each was asked.
    """
    found = []
    for question in inquiry.questions:
        most = MAX_LIMIT_REQUESTS if _general(question) and verdict != "undecided" else MAX_REQUESTS
        if times.get(key_of(question), 0) < most:
            found.append(question)
    return found


def worth_recording(tells: Sequence[ExpectedAnswer]) -> list[ExpectedAnswer]:
    """Return what a motion tells for sure and much surer than is known, and some of which would be believed."""
    return [
        item
        for item in tells
        if item.after >= max(SURE_STANDARD_ERRORS, WORTHWHILE_RATIO * item.before)
        and not 0 < len(item.question.suspects) == len(item.unshown)
    ]


def unanswered_words(tells: Sequence[ExpectedAnswer], duration: float) -> str:
    """Say what would answer the questions that no motion of a duration, s, does: a longer one, or another experiment.

    What a motion tells adds up over its time, so the square of the standard errors between two answers grows in proportion.
    That another motion be recorded is no advice where the best one was designed and does not tell.
    """
    longer, never, others = [], [], []
    for item in tells:
        gained = item.after**2 - item.before**2
        times = (SURE_STANDARD_ERRORS**2 - item.before**2) / gained if gained > 0.0 else np.inf
        if not item.hidden and 1.0 < times <= MAX_TIMES_LONGER:
            longer.append(f"{item.question.text} with --duration {np.ceil(times * duration):g}")
        elif item.question.kind == "parameter":
            never.append(item.question.text)
        else:
            others.append(f"{item.question.text}: {item.remedy}")
    words = [f"No motion of {duration:g} s within the limits answers the open questions."]
    if longer:
        words.append(f"A longer one is expected to answer: {'; '.join(longer)}.")
    if never:
        words.append(f"One {MAX_TIMES_LONGER:g} times as long would not determine: {', '.join(never)}.")
    if others:
        words.append(f"These experiments would: {'; '.join(others)}.")
    return " ".join(words)


def _promised(content: Mapping[str, Any], tells: Sequence[ExpectedAnswer]) -> dict[str, Any]:
    """Return a diagnosis with how far apart the designed motion is expected to bring the answers to what it asks."""
    after = {item.question.text: item.after for item in tells}
    steps = [
        {**step, "sigma_after": after[step["question"]]} if step["question"] in after else step
        for step in content["next"]
    ]
    return {**content, "next": steps}


def _written(folder: Path, design: Design) -> None:
    with written_together(folder / "next") as place:
        write_trajectory(design.trajectories[0], place / FILES[0])
        write_joint_trajectory(design.trajectories[0], place / FILES[1])
        write_json(place / FILES[2], excitation_dict(design))


def _removed(folder: Path) -> None:
    """Remove a motion that is no longer asked for."""
    for name in FILES:
        (folder / "next" / name).unlink(missing_ok=True)
