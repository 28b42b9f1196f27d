"""Candidates that cannot be tested because their columns are not finite on these recordings."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.effects import Scene
from scara_ident.errors import ScaraIdentError
from scara_ident.manners import listed

# Joints and recordings that a line names.
MAX_NAMED = 4


def without_not_finite(
    scene: Scene, columns: CandidateColumns, candidates: Sequence[Candidate], *, asked_for: bool
) -> tuple[tuple[Candidate, ...], tuple[str, ...]]:
    """Return those of some candidates whose columns, made before, are finite, and a note for each effect of which some are not.

    Parameters
    ----------
    asked_for : bool
        Whether somebody chose the effects.

    Raises
    ------
    ScaraIdentError
        If so, and an effect has no finite columns on a joint.
    """
    where = {item: found for item in candidates if (found := columns.not_finite_on(scene, item))}
    kept = tuple(item for item in candidates if item not in where)
    tried = {item.label(scene) for item in kept}
    # By effect, and whether nothing of it can be tried: joints and recordings, in their order.
    lines: dict[tuple[str, bool], tuple[dict[str, None], dict[str, None]]] = {}
    for item, names in where.items():
        joints, recordings = lines.setdefault((item.effect.name, item.label(scene) not in tried), ({}, {}))
        joints[item.joint(scene) or "the arm"] = None
        recordings.update(dict.fromkeys(names))
    notes = []
    for (name, wholly), (joints, recordings) in lines.items():
        label = f"{name} of {listed(list(joints), MAX_NAMED)}"
        some = {item.name for item in columns.observations.data.recordings} - set(recordings)
        place = listed(list(recordings), MAX_NAMED) if some else "any recording"
        mend = ["correct the effect", *([f"leave out {place}"] if some else [])]
        if wholly and asked_for:
            mend.append("leave this effect out")
        what = "cannot be tried" if wholly else "cannot be tried with some values of its parameters"
        said = f"{label} {what}: its columns are not finite on {place}; {', '.join(mend[:-1])}{' or ' * (len(mend) > 1)}{mend[-1]}"
        if wholly and asked_for:
            raise ScaraIdentError(f"effect {said}")
        notes.append(said)
    return kept, tuple(notes)
