"""The verdict, and whether the residual of each joint is noise once all evidence is considered."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Literal

from scara_ident.diagnosis.braking_evidence import braking_evidence
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.evidence.even_evidence import even_evidence
from scara_ident.diagnosis.evidence.evidence import Evidence, evidence, held_out_evidence
from scara_ident.diagnosis.evidence.late_evidence import late_evidence
from scara_ident.diagnosis.evidence.outcome import Outcome
from scara_ident.diagnosis.evidence.standing_lines import StandingLine, without_lines
from scara_ident.diagnosis.evidence.steady_evidence import steady_evidence
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.held_out.gain import spoken_against
from scara_ident.diagnosis.held_out.validation import Validation
from scara_ident.diagnosis.possible_evidence import possible_evidence
from scara_ident.diagnosis.selection.audit import left_open
from scara_ident.estimation.noise_bias import noise_signals
from scara_ident.estimation.run_offsets import rms_of

Verdict = Literal["complete", "explained", "unexplained", "undecided"]


def weighed_evidence(
    outcome: Outcome,
    held_out: Validation,
    effects: Sequence[FoundEffect],
    lines: Sequence[StandingLine | None],
    criteria: SelectionCriteria,
) -> tuple[Evidence, ...]:
    """Return for each joint whether what is left was shown to be noise, and by what.

    Every witness that may speak against it is asked in turn, and the first that does is the one that is reported: what the search
    left open, what is left of the training recordings, lines in it, one of them beside all others, its parts beside each other,
    what comes late in all, those held out, and there each effect. Friction that pushes, and a body or rotor
    that is less than nothing, is reported whatever they say.

    Parameters
    ----------
    lines : sequence of StandingLine or None
        For each joint.
    """
    found, after = outcome.search, outcome.after
    doubtful = (*outcome.suspected, *left_open(found, after.weights, outcome.demoted))
    made = partial(noise_signals, outcome.training, after.value)
    shown = evidence(
        found, outcome.residuals, outcome.fit_after, outcome.small, outcome.of_positions, doubtful, criteria, made
    )
    shown = without_lines(shown, lines, found)
    shown = even_evidence(shown, after, outcome.training, criteria)
    shown = steady_evidence(shown, after, outcome.training, criteria)
    shown = late_evidence(shown, after, outcome.training, criteria)
    training, others = (rms_of(after.value, item) for item in (outcome.training, held_out.undisturbed))
    shown = held_out_evidence(shown, training, others, held_out.unsure, held_out.apart, criteria)
    gains = {item.label: item.held_out for item in effects if item.held_out is not None}
    shown = spoken_against(shown, gains, criteria)
    shown = braking_evidence(shown, after, outcome.training, effects)
    return possible_evidence(shown, after, effects)


def verdict_of(outcome: Outcome, effects: Sequence[FoundEffect], shown: Sequence[Evidence]) -> Verdict:
    """Return the verdict: nothing is called noise that was not shown to be, on every joint."""
    if outcome.unexplained is not None:
        return "unexplained"
    if not all(item.shown for item in shown):
        return "undecided"
    return "explained" if effects else "complete"
