"""The scene at the estimate of a model with effects: the base model's torque, and what effects do to the links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.effects import Scene
from scara_ident.effects.signals import ModelledEffect


def at_estimate(scene: Scene, chosen: Sequence[Candidate], value: Array) -> Scene:
    """Return a scene at the parameters, shape (k,), of the base model and of the effects beside it."""
    start = len(scene.model.columns)
    base, found = value[:start], []
    for item in chosen:
        stop = start + len(item.effect.columns(scene, item.member))
        # What follows from a load is no part of it.
        if item.effect.on_links and item.effect.geared_joint(item.member) is None:
            found.append(ModelledEffect(item.effect, item.member, tuple(value[start:stop].tolist())))
        start = stop
    return replace(scene, value=base, link_torques=tuple(found))


def estimate_of(scene: Scene, chosen: Sequence[Candidate]) -> Array:
    """Return the parameters that a scene is at, shape (k,): 0 for effects of which it knows none."""
    known = {(item.effect, item.member): item.value for item in scene.link_torques}
    parts = [scene.value]
    for item in chosen:
        none = (0.0,) * len(item.effect.columns(scene, item.member))
        parts.append(np.array(known.get((item.effect, item.member), none)))
    return np.concatenate(parts)


def without_others(scene: Scene, chosen: Sequence[Candidate]) -> Scene:
    """Return a scene that knows of no effects but those of a model."""
    members = {(item.effect, item.member) for item in chosen}
    kept = tuple(item for item in scene.link_torques if (item.effect, item.member) in members)
    return scene if len(kept) == len(scene.link_torques) else replace(scene, link_torques=kept)


def moved_with(scene: Scene, before: Sequence[Candidate], after: Sequence[Candidate]) -> Scene:
    """Return a scene in which effects act as other members of their families, such as in other intervals."""
    moved = {(old.effect, old.member): new.member for old, new in zip(before, after, strict=True)}
    torques = tuple(
        replace(item, member=moved.get((item.effect, item.member), item.member)) for item in scene.link_torques
    )
    return replace(scene, link_torques=torques) if torques else scene
