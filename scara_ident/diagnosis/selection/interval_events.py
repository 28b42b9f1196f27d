"""Events that an effect acting in intervals may explain: not left out before that was tested."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.diagnosis.selection.search import SearchTask, scene_of
from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations
from scara_ident.identification.events import SAME_OVERLAP, Event


def not_explained(task: SearchTask, observations: Observations, events: Sequence[Event]) -> tuple[Event, ...]:
    """Return the events that no interval covers in which an effect of the catalogue is seen to act.

    Where the effect is not believed after all its residual is an event again, as it is once the search is over.

    Parameters
    ----------
    observations : Observations
        Of the base model, nothing left out.
    events : sequence of Event
    """
    families = [effect for effect in task.catalogue if effect.in_intervals]
    if not events or not families:
        return tuple(events)
    scene = scene_of(task.model, wls(observations).value, observations)
    names = list(scene.start)
    intervals = [item for effect in families for member in effect.members(scene) for item in member.intervals]

    def covered(event: Event) -> bool:
        both = (
            min(event.stop, item.stop) - max(event.start, item.start)
            for item in intervals
            if names[item.recording] == event.recording
        )
        return max(both, default=0.0) >= SAME_OVERLAP * (event.stop - event.start)

    return tuple(event for event in events if not covered(event))
