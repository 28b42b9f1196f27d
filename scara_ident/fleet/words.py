"""What changed in an arm, in words."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

import numpy as np

from scara_ident.effects import Scene
from scara_ident.effects.parameters import Parameter
from scara_ident.fleet.causes import Cause, sizes_in_words
from scara_ident.fleet.changes import Change

# Of several sizes those are named that differ from zero by so many standard deviations.
NAMED_STDS = 2.0


def sentences(changes: Sequence[Change], scene: Scene) -> tuple[str, ...]:
    """Return changes in words, such as ``Coulomb friction of joint2 up 31 % (± 2 %) since 1 March 2026``; of a cause all together."""
    by_cause: dict[str, list[Change]] = {}
    for change in changes:
        label = f"residual of {change.joint}" if change.cause is None else change.cause.label
        by_cause.setdefault(label, []).append(change)
    return tuple(_sentence(sorted(own, key=lambda item: item.since), scene) for own in by_cause.values())


def _sentence(changes: Sequence[Change], scene: Scene) -> str:
    """Return the changes of one cause in words, the first date first."""
    change = changes[0]
    if change.cause is None:
        std = np.sqrt(change.covariance[0, 0])
        share = _amount("", Parameter(float(change.size[0]), float(std), "1"))
        return f"Residual of {change.joint}{share} since {day(change.since)}; no known cause explains it"
    cause = change.cause
    words = cause.words if cause.joint is None or cause.joint in cause.words else f"{cause.words} on {cause.joint}"
    each = ",".join(
        f"{_size(item, cause, scene, again=k > 0)} {'gradually since' if item.gradual else 'since'} {day(item.since)}"
        for k, item in enumerate(changes)
    )
    alike = ", ".join(dict.fromkeys(other.words for item in changes for other in item.or_else[:3]))
    other = f"; it could also be {alike}" if alike else ""
    total = sum(float(item.size[0]) for item in changes)
    turned = "; its sign is reversed" if cause.effect == "torque_scale" and total < -1.0 else ""
    return f"{words[0].upper()}{words[1:]}{':' if cause.candidate else ''}{each}{turned}{other}"


def _size(change: Change, cause: Cause, scene: Scene, *, again: bool = False) -> str:
    """Return the size of a change in words; a single one that is named before needs no name again."""
    sizes = sizes_in_words(cause, scene, change.size, change.covariance)
    significant = {key: item for key, item in sizes.items() if abs(item.value) > NAMED_STDS * item.std} or sizes
    if cause.effect == "inertia":
        mass = sizes.get("mass")
        if mass is None or abs(mass.value) <= NAMED_STDS * mass.std:
            # A sum of many parameters has no size of its own.
            return f" changed by {change.score:.0f} standard deviations"
        return f" {abs(mass.value):.3g} kg (± {mass.std:.1g}) {'heavier' if mass.value > 0.0 else 'lighter'}"
    shared = cause.candidate is None
    bare = shared or (again and len(sizes) == 1)
    return ",".join(
        _amount("" if bare else f" {key.replace('_', ' ')}", item, shared) for key, item in significant.items()
    )


def day(iso: str) -> str:
    """Return a date in words.

    Examples
    --------
    >>> day("2026-03-01")
    '1 March 2026'
    """
    found = date.fromisoformat(iso)
    return f"{found.day} {found:%B %Y}"


def _amount(name: str, item: Parameter, shared: bool = True) -> str:
    way = "up" if item.value > 0.0 else "down"
    if item.unit == "1" and shared:
        return f"{name} {way} {_percent(abs(item.value), 2)} (± {_percent(item.std, 1)})"
    unit = "" if item.unit == "1" else f" {item.unit}"
    return f"{name} {way} {abs(item.value):.3g}{unit} (± {item.std:.1g})"


def _percent(share: float, digits: int) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.{digits}g} %"
