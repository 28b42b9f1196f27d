"""What the transmissions of a URDF say of drives: reductions and rotor inertias."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.robot.description import JointDescription
from scara_ident.robot.urdf_validation import finite_number


def reductions(
    names: Sequence[str], joints: Sequence[JointDescription], urdf: Path, tree: ElementTree.Element
) -> Array:
    """Return the reduction of each joint, shape (n,): the description's, else the URDF's, else 1."""
    given = [joint.reduction for joint in joints]
    asked = _not_given(names, given)
    from_urdf = _actuator_numbers(tree, urdf, ("mechanicalReduction", "mechanical_reduction"), "reduction", asked)
    for name, value in from_urdf.items():
        if value == 0.0:
            raise RobotError(f"{urdf}: transmission of {name}: mechanicalReduction is 0; expected another number")
    return np.array([_first(value, from_urdf.get(name), 1.0) for name, value in zip(names, given, strict=True)])


def rotor_inertias(
    names: Sequence[str], joints: Sequence[JointDescription], urdf: Path, tree: ElementTree.Element
) -> Array:
    """Return the rotor inertia of each joint, kg m^2 at the motor, shape (n,): NaN where none is stated."""
    given = [joint.rotor_inertia for joint in joints]
    from_urdf = _actuator_numbers(tree, urdf, ("rotorInertia",), "rotor_inertia", _not_given(names, given))
    for name, value in from_urdf.items():
        if value < 0.0:
            raise RobotError(f"{urdf}: transmission of {name}: rotorInertia is {value:g}; expected 0 or more, kg m^2")
    return np.array([_first(value, from_urdf.get(name), np.nan) for name, value in zip(names, given, strict=True)])


def _first(*values: float | None) -> float:
    return float(next(value for value in values if value is not None))


def _not_given(names: Sequence[str], given: Sequence[float | None]) -> set[str]:
    return {name for name, value in zip(names, given, strict=True) if value is None}


def _actuator_numbers(
    tree: ElementTree.Element, urdf: Path, tags: Sequence[str], key: str, asked: Collection[str]
) -> dict[str, float]:
    """Read a number from the transmission of every joint of ``asked`` that has one; ``key`` is what states it instead.

    yourdfpy 0.0.60 parses the element but loses its text (an element without children is false), so the
    file is read here.
    """
    found: dict[str, float] = {}
    for transmission in tree.iter("transmission"):
        texts = [element.text for tag in tags for element in transmission.iter(tag)]
        names = [joint.get("name", "") for joint in transmission.findall("joint")]
        if not texts:
            continue
        for name in names:
            if name not in asked:
                continue
            value = finite_number(texts[0])
            if value is None:
                raise RobotError(
                    f"{urdf}: transmission of {name}: {tags[0]} is {texts[0]!r}; expected a number: correct "
                    f"or remove it, or state {key} of {name} in robot.yaml"
                )
            found[name] = value
    return found
