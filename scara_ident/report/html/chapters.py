"""The effects found, each with the residuals before and after it came in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.diagnose import Diagnosis, FoundEffect
from scara_ident.diagnosis.search import is_delay
from scara_ident.effects.effect import OWN, View
from scara_ident.estimation import Estimate
from scara_ident.recording.recording import Recording
from scara_ident.report.html.traces import Trace, traces

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chapter:
    """One effect with the residual before and after it.

    Attributes
    ----------
    number : int
    effect : str
    joint : int
        The joint whose residual is shown.
    before, after : sequence of Trace
        Of the same recordings in the same order.
    bands : sequence of float or None
    own_joint : str or None
        The joint that the effect belongs to; None where it belongs to no one joint.
    view : View
        What the effect is shown over.
    corrected : bool
        Whether it was corrected in the data, which changes no prediction.
    distance : float or None
        Over which the effect acts after a reversal, rad or m.
    """

    number: int
    effect: str
    joint: int
    before: Sequence[Trace]
    after: Sequence[Trace]
    bands: Sequence[float | None]
    own_joint: str | None = None
    view: View = OWN
    corrected: bool = False
    distance: float | None = None

    @property
    def added(self) -> list[Array] | None:
        """What the effect adds to the prediction, net of what the other parameters give back, (N,) per part.

        None for an effect that was corrected in the data.
        """
        if self.corrected:
            return None
        return [
            after.predicted[self.joint] - before.predicted[self.joint]
            for before, after in zip(self.before, self.after, strict=True)
        ]

    @property
    def own(self) -> list[Array] | None:
        """The effect's own torque within the band, (N,) per part; None where it is none of the model's terms."""
        found = []
        for trace in self.after:
            match = [
                a[self.joint] for name, joint, a in trace.effects if (name, joint) == (self.effect, self.own_joint)
            ]
            if not match:
                return None
            found.append(match[-1])
        return found


def chapters(diagnosis: Diagnosis, recordings: Sequence[Recording]) -> list[tuple[FoundEffect, Chapter]]:
    """Return the effects in the order in which they came in, each with the residuals before and after.

    Parameters
    ----------
    diagnosis : Diagnosis
    recordings : sequence of Recording
        Those that every choice was made on, as they were given.
    """
    search = diagnosis.search
    corrected: Sequence[Recording] = recordings
    before = _all_traces(search.start, corrected, search.bands)
    found: list[tuple[FoundEffect, Chapter]] = []
    for step in search.steps:
        candidate = step.decision.candidate
        name, joint, view = candidate.effect.name, candidate.joint(search.scene), candidate.effect.view
        if is_delay(candidate):
            corrected = search.recordings
        after = _all_traces(step.estimate, corrected, search.bands)
        effect = diagnosis.effects[len(found)] if len(found) < len(diagnosis.effects) else None
        # Otherwise a correction too small to be called an effect.
        if effect is not None and (effect.effect, effect.joint) == (name, joint):
            acts = effect.parameters.get(view.distance or "")
            chapter = Chapter(
                len(found) + 1,
                name,
                _shown_joint(effect, diagnosis),
                before,
                after,
                search.bands,
                joint,
                view,
                is_delay(candidate),
                None if acts is None else acts.value,
            )
            found.append((effect, chapter))
        before = after
    return found


def _all_traces(estimate: Estimate, recordings: Sequence[Recording], bands: Sequence[float | None]) -> list[Trace]:
    return [part for recording in recordings for part in traces(estimate.model, estimate.value, recording, bands)]


def _shown_joint(effect: FoundEffect, diagnosis: Diagnosis) -> int:
    """Return the effect's joint, or the one where it removes the largest share."""
    joints = diagnosis.robot.joints
    if effect.joint is not None:
        return joints.index(effect.joint)
    ratios = [(effect.after[joint] or 0.0) / (effect.before[joint] or 1.0) for joint in joints]
    return ratios.index(min(ratios))
