"""The effects found, each with the residuals before and after it entered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

from scara_ident.arrays import Array
from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.testing.selection_step import observed_at_every_sample
from scara_ident.effects.parameters import OWN, View
from scara_ident.report.traces import Trace, traces


@dataclass(frozen=True, eq=False)
class Chapter:
    """One effect with the residual before and after it.

    Attributes
    ----------
    joint : int
        The joint whose residual is shown.
    before, after : sequence of Trace
        Of the same recordings in the same order.
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
            before.residual[self.joint] - after.residual[self.joint]
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


def chapters(diagnosis: Diagnosis) -> list[tuple[FoundEffect, Chapter]]:
    """Return the effects in the order in which they came in, each with the residuals before and after."""
    search = diagnosis.search
    if not search.steps:
        return []
    before = list(chain.from_iterable(traces(search.uncorrected, search.start.value)))
    found: list[tuple[FoundEffect, Chapter]] = []
    for step in search.steps:
        candidate = step.decision.candidate
        name, joint, view = candidate.effect.name, candidate.joint(search.scene), candidate.effect.view
        observations = observed_at_every_sample(replace(search.step, scene=step.scene, chosen=step.chosen))
        after = list(chain.from_iterable(traces(replace(observations, data=step.data), step.value)))
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
                candidate.corrects_data,
                None if acts is None else acts.value,
            )
            found.append((effect, chapter))
        before = after
    return found


def _shown_joint(effect: FoundEffect, diagnosis: Diagnosis) -> int:
    """Return the effect's joint, or the one where it removes the largest share."""
    joints = diagnosis.robot.joints
    if effect.joint is not None:
        return joints.index(effect.joint)
    ratios = [(effect.after[joint] or 0.0) / (effect.before[joint] or 1.0) for joint in joints]
    return ratios.index(min(ratios))
