"""Joints that a URDF couples to another by ``<mimic>``: they have no motion of their own."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scara_ident.errors import RobotError


@dataclass(frozen=True)
class Follower:
    """A joint that follows another: position = multiplier x that of ``master`` + offset.

    Attributes
    ----------
    master : str
        A joint that follows none.
    multiplier, offset : float
        1, or m/rad and the like where one turns and the other slides; rad or m.
    """

    master: str
    multiplier: float
    offset: float


def followers(tree: ElementTree.Element) -> dict[str, Follower]:
    """Return the joints of a URDF that follow another, by name.

    Parameters
    ----------
    tree : Element
        The element ``<robot>`` of a URDF that has been checked.
    """
    stated: dict[str, Follower] = {}
    for joint in tree.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") != "fixed":
            multiplier, offset = (float(mimic.get(key, default)) for key, default in (("multiplier", 1), ("offset", 0)))
            stated[joint.get("name", "")] = Follower(mimic.get("joint", ""), multiplier, offset)
    return {name: _resolved(name, stated) for name in stated}


def coupled_ends(tree: ElementTree.Element, coupled: Mapping[str, Follower], movable: Sequence[str]) -> set[str]:
    """Return the masters that carry nothing but what follows them, as the first finger of a gripper does."""
    free = set(movable) - set(coupled)
    ends = set()
    for master in {follower.master for follower in coupled.values()} & free:
        own = {master, *(name for name, follower in coupled.items() if follower.master == master)}
        if not any(_carried(tree, name) & (free - own) for name in own):
            ends.add(master)
    return ends


def lock_followers(locked: Mapping[str, float], coupled: Mapping[str, Follower]) -> dict[str, float]:
    """Return positions of locked joints with those that follow from a locked master; a position that is stated stays."""
    found = {
        name: follower.multiplier * locked.get(follower.master, 0.0) + follower.offset
        for name, follower in coupled.items()
    }
    return found | dict(locked)


def refuse_coupled(names: Collection[str], coupled: Mapping[str, Follower], source: Path) -> None:
    """Refuse to identify a joint that follows another, or one that others follow.

    Raises
    ------
    RobotError
    """
    for name, follower in coupled.items():
        if name in names:
            raise RobotError(
                f"{source}: joints.{name}: follows {follower.master} (mimic) and has no motion of its own; leave it out, "
                "or remove <mimic> from the URDF if it has a drive of its own"
            )
        if follower.master in names:
            raise RobotError(
                f"{source}: joints.{follower.master}: {name} follows it (mimic), and coupled joints are not modelled; leave "
                f"it out (both are then locked), or make {name} fixed in the URDF if it hardly weighs"
            )


def _resolved(name: str, stated: Mapping[str, Follower]) -> Follower:
    result, passed = stated[name], {name}
    while result.master in stated and result.master not in passed:
        passed.add(result.master)
        above = stated[result.master]
        result = Follower(
            above.master, result.multiplier * above.multiplier, result.multiplier * above.offset + result.offset
        )
    return result


def _carried(tree: ElementTree.Element, joint: str) -> set[str]:
    """Return the joints beyond a joint."""
    ends = {}
    for item in tree.findall("joint"):
        parent, child = item.find("parent"), item.find("child")
        if parent is not None and child is not None:
            ends[item.get("name", "")] = (parent.get("link"), child.get("link"))
    found: set[str] = set()
    links = {ends[joint][1]}
    while links:
        beyond = {name for name, (parent, _) in ends.items() if parent in links} - found
        found |= beyond
        links = {ends[name][1] for name in beyond}
    return found
