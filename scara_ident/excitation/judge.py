"""How well a motion answers open questions, as one number: exactly, and by a fast approximation.

A motion is judged by what the diagnosis would see and believe of it: its columns within the bands, over the noise, block of
time by block, beside what is known. Most of that takes time for little: a motion is smooth, so that few samples a second show
its columns; the test's standard errors hardly differ from motion to motion once evidence is spread; and effects that the
recordings say little for count little. A glance leaves these out, in about a tenth of the time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import compress

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import Information
from scara_ident.excitation.curves import Basis
from scara_ident.excitation.promise import SURE_STANDARD_ERRORS, KnownBlocks, all_rows
from scara_ident.excitation.search import UNSEEN
from scara_ident.excitation.verification import grid
from scara_ident.inquiry.answerability import Inquiry, known_rows
from scara_ident.inquiry.belief import Blocks, believed, known_blocks
from scara_ident.inquiry.questions import Question
from scara_ident.motion.motion import Motion
from scara_ident.motion.rest import Bands

# Samples per second of a motion that is judged, and where a suspect follows the motor's turns.
RATE, TURNING_RATE = 200.0, 500.0
# Samples per second at a glance, and per period of the widest band: what turns faster than that is not within it.
GLANCE_RATE, PER_PERIOD = 100.0, 5.0
# Of what may be below the limit those that weigh less than this together are not looked at in a glance.
GLANCE_SHARE = 0.05
# Weights of kinds of questions against that of what may be below the limit: what was found comes first.
WEIGHTS = {"confounders": 2.0, "unexplained": 2.0, "below_limit": 1.0, "parameter": 0.2}
# How many times what is needed is worth having: noise and size are foreseen to a factor or two.
ENOUGH_RATIO = 5.0


@dataclass(frozen=True, eq=False)
class Judge:
    """What motions of a basis about a posture are worth.

    Attributes
    ----------
    posture : ndarray, shape (n,)
    """

    inquiry: Inquiry
    basis: Basis
    posture: Array

    def cost(self, x: Array) -> float:
        """Return minus the weighted sum of the logarithms of what questions gain, up to what is enough.

        Where something may be below the limit, with that of what nobody thought of.

        Parameters
        ----------
        x : ndarray, shape (1, n, m)
            Coefficients of the motion.
        """
        turning = any(item.candidate.effect.seeded_by == "order" for item in self.inquiry.suspects)
        return self._in_full.cost(self._motion(x, TURNING_RATE if turning else RATE))

    def glance(self, x: Array) -> float:
        """Return about what `cost` returns, which differs from it by nearly as much for one motion as for the next.

        Parameters
        ----------
        x : ndarray, shape (1, n, m)
        """
        return self._likely.cost(self._motion(x, self._glance_rate), in_short=True)

    @cached_property
    def _glance_rate(self) -> float:
        bands = [TURNING_RATE / PER_PERIOD if band is None else band for band in self.inquiry.bands]
        return float(np.clip(PER_PERIOD * max(bands), GLANCE_RATE, TURNING_RATE))

    def _motion(self, x: Array, rate: float) -> Motion:
        return motion_of(self.basis, self.posture, x[0], rate)

    @cached_property
    def _in_full(self) -> _Worth:
        return _Worth(each_alone(self.inquiry))

    @cached_property
    def _likely(self) -> _Worth:
        """The same of the suspects that count most."""
        whole = self._in_full
        order = np.argsort(-whole.weights, kind="stable")
        below = np.array([item.kind == "below_limit" for item in whole.inquiry.questions])[order]
        before = np.cumsum(np.where(below, whole.weights[order], 0.0)) - whole.weights[order]
        kept = np.sort(order[~below | (before < (1.0 - GLANCE_SHARE) * WEIGHTS["below_limit"])])
        if len(kept) == len(order):
            return whole
        fewer = replace(whole.inquiry, questions=tuple(whole.inquiry.questions[k] for k in kept))
        if fewer.columns is not None:
            fewer = replace(fewer, known=known_rows(fewer, fewer.columns))
        return _Worth(fewer)


@dataclass(frozen=True, eq=False)
class _Worth:
    """Questions of which each that may be below the limit asks for one effect, see `each_alone`."""

    inquiry: Inquiry

    def cost(self, motion: Motion, *, in_short: bool = False) -> float:
        asked = self.inquiry.questions
        rows = all_rows(self.inquiry, [motion], self.known_in_short if in_short else self.known, in_short=in_short)
        sure = believed(self.inquiry, rows)
        sizes = np.array([sure.get(item.text, 0.0) if item.kind == "below_limit" else 0.0 for item in asked])
        rest = [item.kind != "below_limit" for item in asked]
        if any(rest):
            sizes[rest] = self.inquiry.sigmas(rows.information, [*compress(asked, rest)]) / SURE_STANDARD_ERRORS
        information = float(self.weights @ np.log((1.0 + sizes**2) / (1.0 + (sizes / ENOUGH_RATIO) ** 2)))
        return -information - (0.0 if all(rest) else WEIGHTS["below_limit"] * self._of_the_rest(rows.information))

    def _of_the_rest(self, rows: Information) -> float:
        """Return the mean logarithm of the squares that tell a parameter of the model.

        What is below the limit may be none of what is asked for: effects of joints that hardly moved are not even tried, and
        nonlinear parameters of the others are those that noise left. Both show where the whole workspace is seen, so that the
        log determinant counts as much as all that is asked for: DT-optimality (Atkinson 2008).
        """
        count = len(self.inquiry.scene.model.columns)
        size = np.abs(np.diag(rows.factor)[:count])
        return float(2.0 * np.mean(np.log(np.maximum(size, UNSEEN * np.max(size)))))

    @cached_property
    def known(self) -> KnownBlocks:
        """The rows of the recordings at hand, made once for all motions with which they have the same bands."""
        return cache(known_blocks)

    @cached_property
    def known_in_short(self) -> KnownBlocks:
        """The same `Blocks.in_short`."""

        def made(inquiry: Inquiry, bands: Bands) -> Blocks | None:
            blocks = known_blocks(inquiry, bands)
            return None if blocks is None else blocks.in_short(1)

        return cache(made)

    @cached_property
    def weights(self) -> Array:
        """Questions of one kind share its weight, those of what may be below the limit by the odds of each."""
        kinds = [item.kind for item in self.inquiry.questions]
        odds = np.array(
            [item.suspects[0].odds if item.kind == "below_limit" else 1.0 for item in self.inquiry.questions]
        )
        total = {kind: sum(odds[k] for k, other in enumerate(kinds) if other == kind) for kind in kinds}
        return np.array([WEIGHTS[kind] * share / total[kind] for kind, share in zip(kinds, odds, strict=True)])


def each_alone(inquiry: Inquiry) -> Inquiry:
    """Return an inquiry with a question for each of several that may be below the limit.

    How large the one that is there may be is not known: each counts by the logarithm of what it gains, and one that no
    motion shows keeps none from showing the others.
    """
    return replace(inquiry, questions=tuple(alone for item in inquiry.questions for alone in _alone(item)))


def _alone(question: Question) -> list[Question]:
    """Return a question for each suspect that may be below the limit; any other as it is."""
    if question.kind != "below_limit":
        return [question]
    return [replace(question, text=item.label, suspects=(item,)) for item in question.suspects]


def motion_of(basis: Basis, posture: Array, coefficients: Array, rate: float) -> Motion:
    """Return samples of a motion at equal steps over its period, the end left out."""
    count = round(basis.duration * rate)
    time = np.arange(count, dtype=np.float64) / rate
    q, v, a = (coefficients @ rows.T for rows in rows_over(basis, count)[:3])
    return Motion("asked", "asked", time, q + posture[:, None], v, a, None, rate)


@lru_cache(maxsize=8)
def rows_over(basis: Basis, count: int) -> Array:
    """Return a basis and its derivatives at equal steps over its period, shape (4, count, m)."""
    return grid((basis,), count)[:, 0]
