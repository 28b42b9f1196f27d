"""Expected answers: how sure a motion would make the answers to questions, and from which size on effects would be found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, Rows
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.effects import Parameter, Scene, Signals
from scara_ident.inquiry.answerability import Inquiry
from scara_ident.inquiry.belief import Blocks, believed, known_blocks
from scara_ident.inquiry.questions import MAX_NAMED, Question, Suspect
from scara_ident.manners import listed
from scara_ident.motion.motion import Motion
from scara_ident.motion.rest import Bands
from scara_ident.motion.sampling import block_seconds

# Samples per second of a motion whose promise is given.
FINE_RATE = 1000.0
# Standard errors at which an answer is sure enough.
SURE_STANDARD_ERRORS = 5.0

KnownBlocks = Callable[[Inquiry, Bands], Blocks | None]


@dataclass(frozen=True)
class Shown:
    """How large an effect that may be below the limit has to be, to be found with a motion.

    Attributes
    ----------
    suspect : Suspect
        Of a size that the recordings at hand would just have shown.
    times : float
        How many times as large as the diagnosis will need it that is.
    limit : mapping of str to Parameter
        The parameter of the least that would be found; empty where no single one says how large it is.
    """

    suspect: Suspect
    times: float
    limit: Mapping[str, Parameter]


@dataclass(frozen=True)
class ExpectedAnswer:
    """What a motion tells of a question.

    Attributes
    ----------
    question : Question
    before, after : float
        Standard errors between the answers, without and with it.
    shown : tuple of Shown
        Of effects that may be below the limit, each.
    untried : tuple of Suspect
        Effects of which the motion still holds too little for the diagnosis to try them, see `Effect.doubtful`.
    """

    question: Question
    before: float
    after: float
    shown: tuple[Shown, ...] = ()
    untried: tuple[Suspect, ...] = ()

    @property
    def hidden(self) -> tuple[Suspect, ...]:
        """Effects that would not be found if they are there, those below the limit as large as they may just be."""
        return (*self.untried, *(x.suspect for x in self.shown if x.times < 1.0 and x.suspect not in self.untried))

    @property
    def unshown(self) -> tuple[str, ...]:
        """Labels of `hidden`."""
        return tuple(item.label for item in self.hidden)

    @property
    def settled(self) -> bool:
        """Whether the diagnosis is expected to be sure of the answer afterwards, whichever is true."""
        return not self.hidden and (self.question.kind == "below_limit" or self.after >= SURE_STANDARD_ERRORS)

    @property
    def words(self) -> str:
        """Say for a person what it tells, from which size on, and what would tell what it does not."""
        said = f"{self.before:.2g} standard errors apart so far, {self.after:.2g} expected with it."
        least = [f"{item.suspect.label}, {_size(item.limit)}" for item in self.shown if item.limit]
        if least:
            said += f" Smallest sizes that would be found: {'; '.join(least[:MAX_NAMED])}."
        return f"{said} {self.instead}".rstrip()

    @property
    def instead(self) -> str:
        """Say what the motion does not tell, and what would; nothing where it tells all."""
        if self.settled:
            return ""
        which = listed([item.label for item in self.hidden], MAX_NAMED) or self.question.text
        return f"This motion does not settle: {which}. To settle it: {self.remedy}."

    @property
    def remedy(self) -> str:
        """Say what tells what the motion does not; of several effects the experiment of each, of the first few."""
        unshown = self.hidden[:MAX_NAMED]
        experiments = dict.fromkeys(item.candidate.effect.experiment for item in unshown)
        return "; ".join(experiments) if len(self.question.suspects) > 1 and unshown else self.question.experiment

    def entry(self) -> dict[str, object]:
        """Return it as plain values."""
        return {
            "question": self.question.text,
            "sigma_before": self.before,
            "sigma_after": self.after,
            "settled": self.settled,
            "unshown": list(self.unshown),
            "detection_limit": {
                item.suspect.label: {name: own.value for name, own in item.limit.items()} for item in self.shown
            },
        }


def _size(limit: Mapping[str, Parameter]) -> str:
    return ", ".join(
        f"{name.replace('_', ' ')} {item.value:.2g}{'' if item.unit == '1' else f' {item.unit}'}"
        for name, item in limit.items()
    )


def expected_answers(inquiry: Inquiry, motions: Sequence[Motion]) -> tuple[ExpectedAnswer, ...]:
    """Return what motions tell of every question, beside what is known."""
    rows = all_rows(inquiry, motions)
    times, after = believed(inquiry, rows), inquiry.sigmas(rows.information)
    scene, found = _moved(inquiry.scene, motions), []
    for item, one, other in zip(inquiry.questions, inquiry.sigmas(), after, strict=True):
        asked = item.suspects if item.kind == "below_limit" else ()
        shown = (Shown(own, times[own.label], _least(inquiry.scene, own, times[own.label])) for own in asked)
        untried = tuple(own for own in item.suspects if own.candidate.member in own.candidate.effect.doubtful(scene))
        found.append(ExpectedAnswer(item, float(one), float(other), tuple(shown), untried))
    return tuple(found)


def _moved(scene: Scene, motions: Sequence[Motion]) -> Scene:
    """Return a scene that reaches as far and as fast as motions do besides."""
    travel = [scene.travel, *(np.ptp(item.q, axis=1) for item in motions)]
    speed = [scene.speed, *(np.max(np.abs(item.v), axis=1) for item in motions)]
    return replace(scene, travel=np.max(travel, axis=0), speed=np.max(speed, axis=0))


def _least(scene: Scene, suspect: Suspect, times: float) -> Mapping[str, Parameter]:
    """Return how large the least is that would be found: one so many times smaller."""
    value, effect = np.abs(suspect.value), suspect.candidate.effect
    if not times > 0.0:
        return {}
    found = effect.parameters(scene, suspect.candidate.member, value / times, np.zeros((len(value), len(value))))
    return dict([next(iter(found.items()))]) if len(value) == 1 or len(found) == 1 else {}


def all_rows(
    inquiry: Inquiry, motions: Sequence[Motion], known: KnownBlocks = known_blocks, *, in_short: bool = False
) -> Blocks:
    """Return all rows that there will be: of what is known, in the bands that it then has, and of motions.

    Parameters
    ----------
    inquiry : Inquiry
    motions : sequence of Motion
        Each at rest at both ends.
    known : callable, optional
        Makes the rows of what is known, `known_blocks`.
    in_short : bool, optional
        Whether those of motions are `Blocks.in_short`, as those of what is known then have to be.
    """
    each = [rows_in_blocks(inquiry, motion) for motion in motions]
    new = [blocks for blocks, _ in each]
    held = known(inquiry, tuple(map(_widest, zip(*(bands for _, bands in each), strict=True))))
    if in_short:
        # Trajectories are the folds where there are several.
        new = [blocks.in_short(1 if held is not None or len(new) > 1 else CRITERIA.parts) for blocks in new]
    return reduce(Blocks.with_more, new if held is None else [held, *new])


def _widest(bands: Sequence[float | None]) -> float | None:
    some = [band for band in bands if band is not None]
    return max(some) if len(some) == len(bands) else None


def rows_in_blocks(inquiry: Inquiry, motion: Motion) -> tuple[Blocks, tuple[float | None, ...]]:
    """Return what a motion would say of an inquiry: rows of unit noise within the bands, in blocks of time; and the bands, Hz.

    Parameters
    ----------
    inquiry : Inquiry
    motion : Motion
        At rest at both ends.

    Notes
    -----
    A period of a signal within a band is determined by as many equal steps as it has Fourier coefficients there, and by
    Parseval's theorem their squares are those of all samples; white noise is then as large in any of them.
    """
    signals = Signals(inquiry.scene, motion)
    model, count = inquiry.scene.model, motion.samples
    seconds, bands, fade = count / motion.rate, inquiry.bands, np.ones(motion.v.shape)
    if inquiry.reach is not None:
        torque = [inquiry.scene.value[own] @ raw for own, raw in zip(model.active, signals.columns, strict=True)]
        bands, fade = inquiry.reach.foreseen(np.array(torque), motion.v, motion.rate)

    def within(joint: int, columns: Array) -> Array:
        band = bands[joint]
        kept = count // 2 + 1 if band is None else min(count // 2 + 1, int(band * seconds) + 1)
        steps = 2 * kept - 1
        size = np.sqrt(steps / (count * motion.rate * inquiry.noise[joint]))
        return np.asarray(size * np.fft.irfft(np.fft.rfft(fade[joint] * columns, axis=1)[:, :kept], steps, axis=1))

    def made(wanted: Sequence[Candidate]) -> list[Rows]:
        each = [item.effect.by_joint(signals, item.member) for item in wanted]
        return [{joint: within(joint, np.array(own)) for joint, own in item.items()} for item in each]

    added = inquiry.rows(made)
    widths = [len(next(iter(rows.values()))) for rows in added]
    total = len(model.columns) + sum(widths)
    blocks = max(1, round(seconds / block_seconds(bands)))
    tables, starts = [], []
    for joint, (own, raw) in enumerate(zip(model.active, signals.columns, strict=True)):
        base = within(joint, raw)
        table = np.zeros((total, base.shape[1]))
        table[own] = base
        start = len(model.columns)
        for rows, width in zip(added, widths, strict=True):
            if joint in rows:
                table[start : start + width] = rows[joint]
            start += width
        tables.append(table)
        starts.append(np.linspace(0, table.shape[1], blocks + 1).astype(np.intp))
    owner = np.zeros(blocks, dtype=np.intp)
    return Blocks(tuple(tables), tuple(starts), owner, owner), tuple(bands)
