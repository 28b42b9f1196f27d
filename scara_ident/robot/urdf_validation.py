"""Why a URDF cannot be used, where its parser does not say so."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from xml.etree import ElementTree

MOVABLE = ("revolute", "continuous", "prismatic")
# Within these, squares and products of what a link and a joint have stay far from the ends of a double: kg, kg m^2.
HEAVIEST = 1e9
# Moments that are 0 but for the arithmetic of what wrote them may be below it by this share of the largest.
ROUNDING = 1e-9
# Radius of gyration, m, below which a mass is a point: what is left of subtracting its own offset is rounding.
NO_WIDTH = 1e-7
# The robot is as long as the offsets of its joints and their strokes, and at least a metre; a centre of mass this many
# times as far from its link is in another unit.
FARTHEST_COM = 10.0
# An axis shorter than this has no direction; it is a unit vector, or nearly.
SHORTEST_AXIS = 1e-6
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# How many numbers an attribute holds, by element.
_COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA, 1),
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}


def urdf_fault(tree: ElementTree.Element) -> str | None:
    """Return what keeps a URDF from being the model of a robot; None where nothing is found.

    Parameters
    ----------
    tree : Element
        The element ``<robot>``.

    Returns
    -------
    str or None
        A few words that name the links or joints, and what to do: for what is xacro's, links and joints that are not
        one tree, numbers that are none or that no body and no joint has, and joints that mimic nothing.
    """
    checks = (_xacro, _no_tree, _no_numbers, _impossible_bodies, _impossible_joints, _broken_mimic, _far_mass)
    return next((fault for check in checks if (fault := check(tree)) is not None), None)


def finite_number(text: str | None) -> float | None:
    """Read a number as URDFs have it, ``-0.5`` or ``1e-3``; None where the text is another thing or infinite."""
    words = (text or "").strip()
    value = float(words) if _NUMBER.fullmatch(words) else math.inf
    return value if math.isfinite(value) else None


def _xacro(tree: ElementTree.Element) -> str | None:
    for element in tree.iter():
        if "}" in element.tag and "xacro" in element.tag.partition("}")[0]:
            return f"it has <xacro:{element.tag.partition('}')[2]}>, so it is xacro's; {XACRO}"
        written = next((value for value in element.attrib.values() if "${" in value or "$(" in value), None)
        if written is not None and element.tag not in ("mesh", "texture"):
            return f"{written!r} in <{element.tag}> is xacro's; {XACRO}"
    return None


XACRO = "run xacro first and give what it writes: xacro robot.urdf.xacro > robot.urdf"
"""What to do with a file of xacro."""


def _no_tree(tree: ElementTree.Element) -> str | None:
    links = [link.get("name", "") for link in tree.findall("link")]
    joints = tree.findall("joint")
    for kind, names in (("joint", [joint.get("name", "") for joint in joints]), ("link", links)):
        twice = _repeated(names)
        if "" in names:
            return f"a {kind} has no name; give it one"
        if twice is not None:
            return f"two {kind}s are named {twice!r}; rename one"
    children: list[str] = []
    above: dict[str, str] = {}
    for joint in joints:
        ends: list[str] = []
        for role in ("parent", "child"):
            element = joint.find(role)
            name = None if element is None else element.get("link")
            if name is None:
                return f"joint {joint.get('name')!r} has no {role} link; name it"
            if name not in links:
                return (
                    f"joint {joint.get('name')!r} names {name!r} as its {role}, and there is no such link; correct it"
                )
            ends.append(name)
        if ends[0] == ends[1]:
            return f"joint {joint.get('name')!r}: link {ends[0]!r} is its parent and its child; a URDF has no loops, name two"
        children.append(ends[1])
        above[ends[1]] = ends[0]
    twice = _repeated(children)
    if twice is not None:
        return f"link {twice!r} is the child of two joints; a URDF has no loops, remove one"
    roots = [name for name in links if name not in children]
    if not roots:
        return "every link is the child of a joint; a URDF has no loops, and begins at a link that is no child"
    if len(roots) > 1:
        return (
            f"links {', '.join(map(repr, roots[:3]))} have no joint to a parent; only one link, the base, may have none"
        )
    reached = set(roots)
    for name in links:
        path: list[str] = []
        while name not in reached and name not in path:
            path.append(name)
            name = above[name]
        if name not in reached:
            return f"link {name!r} is connected to itself; a URDF has no loops, remove one of its joints"
        reached.update(path)
    return None


def _no_numbers(tree: ElementTree.Element) -> str | None:
    for owner, element in _parts(tree):
        for key, count in _COUNTS.get(element.tag, {}).items():
            text = element.get(key)
            if text is None:
                continue
            words = text.split() if count > 1 else [text]
            if len(words) != count or any(finite_number(word) is None for word in words):
                wanted = "a finite number" if count == 1 else f"{count} finite numbers"
                return (
                    f"{owner}: {key} of <{element.tag}> is {_short(text)}; expected {wanted}, "
                    "with a point and without a unit"
                )
    return None


def _impossible_bodies(tree: ElementTree.Element) -> str | None:
    for link in tree.findall("link"):
        owner, inertial = f"link {link.get('name')!r}", link.find("inertial")
        if inertial is None:
            continue
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        given = {} if mass is None or mass.get("value") is None else {"mass": _value(mass, "value")}
        given |= {key: _value(inertia, key) for key in INERTIA if inertia is not None and inertia.get(key) is not None}
        lacking = next((key for key in ("mass", *INERTIA) if key not in given), None)
        if lacking is not None:
            return f"{owner}: its <inertial> has no {lacking}; give it, or leave out <inertial>"
        rounding = max(ROUNDING * max(abs(given[key]) for key in INERTIA), NO_WIDTH**2 * given["mass"])
        for key in ("mass", "ixx", "iyy", "izz"):
            if given[key] < (0.0 if key == "mass" else -rounding):
                return f"{owner}: {key} is {given[key]:g}, but it cannot be below 0; correct it"
        for key, value in given.items():
            if abs(value) > HEAVIEST:
                unit = "kg" if key == "mass" else "kg m^2"
                return f"{owner}: {key} is {value:g} {unit}, which no link of a robot has; correct it"
    return None


def _impossible_joints(tree: ElementTree.Element) -> str | None:
    for joint in tree.findall("joint"):
        owner, kind = f"joint {joint.get('name')!r}", joint.get("type")
        if kind not in MOVABLE:
            continue
        axis, limit = joint.find("axis"), joint.find("limit")
        if axis is not None and axis.get("xyz") is not None and math.hypot(*_vector(axis, "xyz")) < SHORTEST_AXIS:
            return f"{owner}: its axis is {axis.get('xyz')}, which has no direction; give one, such as 0 0 1"
        if limit is None:
            if kind != "continuous":
                return (
                    f'{owner}: a {kind} joint has no <limit>; give it: <limit lower="" upper="" effort="" velocity=""/>'
                )
            continue
        for key in ("effort", "velocity"):
            if limit.get(key) is None:
                return f"{owner}: its <limit> has no {key}; give it"
            if _value(limit, key) < 0.0:
                return f"{owner}: {key} of <limit> is {limit.get(key)}; expected 0 or more"
        low, high = _value(limit, "lower"), _value(limit, "upper")
        if kind != "continuous" and low > high:
            return f"{owner}: its lower limit {low:g} is above its upper limit {high:g}; exchange or correct them"
    return None


def _broken_mimic(tree: ElementTree.Element) -> str | None:
    joints = {joint.get("name", ""): joint for joint in tree.findall("joint")}
    mimics = {
        name: element.get("joint", "") for name, joint in joints.items() if (element := joint.find("mimic")) is not None
    }
    for name, other in mimics.items():
        if other not in joints:
            return f"joint {name!r} mimics {other!r}, and there is no such joint; name one, or leave out <mimic>"
        seen = [name]
        while other in mimics and other not in seen:
            seen.append(other)
            other = mimics[other]
        if other in seen:
            ring = "itself" if len(seen) == 1 else f"{seen[1]!r}, which follows it in turn"
            return f"joint {name!r} mimics {ring}; name a joint that moves by itself, or leave out <mimic>"
    return None


def _far_mass(tree: ElementTree.Element) -> str | None:
    """Find a centre of mass that is far outside the robot: its unit is not the metre."""
    length = 1.0
    for joint in tree.findall("joint"):
        origin, limit = joint.find("origin"), joint.find("limit")
        length += math.hypot(*_vector(origin, "xyz"))
        if joint.get("type") == "prismatic" and limit is not None:
            length += _value(limit, "upper") - _value(limit, "lower")
    for link in tree.findall("link"):
        distance = math.hypot(*_vector(link.find("inertial/origin"), "xyz"))
        if distance > FARTHEST_COM * length:
            return (
                f"link {link.get('name')!r}: its centre of mass is {distance:.4g} m away, and the robot is {length:.3g} m "
                "long; lengths in a URDF are in m, correct it"
            )
    return None


def _parts(tree: ElementTree.Element) -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield the elements of links and joints with words for their owner."""
    for kind in ("link", "joint"):
        for owner in tree.findall(kind):
            yield from ((f"{kind} {owner.get('name')!r}", element) for element in owner.iter())


def _vector(element: ElementTree.Element | None, key: str) -> list[float]:
    text = None if element is None else element.get(key)
    return [0.0, 0.0, 0.0] if text is None else [float(word) for word in text.split()]


def _value(element: ElementTree.Element, key: str) -> float:
    return float(element.get(key, "0"))


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else f"{text[:40]}...")


def _repeated(names: Iterable[str]) -> str | None:
    return next((name for name, count in Counter(names).items() if count > 1), None)
