"""What of a diagnosis is right: the effects that it names beside those that the arm had."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Item = dict[str, Any]
# What stands behind an effect that is named where runs differ: it is there, in each run or day with another size.
BEHIND = {"time_delay": "delay", "torque_gain_mismatch": "scale"}
# Of its size, by which what was taken out of the data, or the stiffness of a contact, may lie off.
CLOSE = 0.25


def hits(item: Item) -> list[bool]:
    """Return for each true effect whether it was found, by its name or in a group that is said to hold it.

    A delay of less than a sample, which is taken out of the data and said, but not called an effect, counts as found.
    """
    return [
        _taken_out(item, true)
        or any(
            (found["effect"] == true["effect"] and found["joint"] == true["joint"]) or true["effect"] in found["group"]
            for found in item["found"]
        )
        for true in item["true"]
    ]


def _taken_out(item: Item, true: Item) -> bool:
    value = item.get("corrected", {}).get(true["effect"])
    size = true["parameters"].get(BEHIND.get(true["effect"], ""))
    if size is not None:
        # Of these runs, which may be late by more of their own.
        size = item.get("late", size)
    return value is not None and size is not None and abs(value - size) <= CLOSE * abs(size)


def right(item: Item) -> bool:
    """Return whether all that is there was found and nothing else."""
    return all(hits(item)) and not wrong(item)


def wrong(item: Item) -> list[str]:
    """Return the effects named that are not there, nor in one or a group with one that is, nor in how runs differ."""
    return [found["effect"] for found in not_there(item)]


def not_there(item: Item) -> list[Item]:
    """Return what was found of the effects that `wrong` names."""
    true = {(each["effect"], each["joint"]) for each in item["true"]}
    names = {each["effect"] for each in item["true"]}
    variation = item.get("conditions", {}).get("variation", {})
    return [
        found
        for found in item["found"]
        if (found["effect"], found["joint"]) not in true
        and not names & set(found["group"])
        and not any(_contact(found, each) for each in item["true"])
        and not _carried(found, item.get("true_events", []))
        and not variation.get(BEHIND.get(found["effect"], ""), 0.0)
    ]


def _carried(found: Item, events: Sequence[Item]) -> bool:
    """Return whether a payload is named where one is carried for a while."""
    return found["effect"] == "payload_change" and any(event["kind"] == "payload" for event in events)


def _contact(found: Item, true: Item) -> bool:
    """Return whether an elastic gear is named with the stiffness of the flanks that close a clearance of the same joint."""
    size = true["parameters"].get("contact_stiffness")
    if size is None or (found["effect"], found["joint"]) != ("joint_elasticity", true["joint"]):
        return False
    return bool(abs(found["parameters"]["stiffness"][0] - size) <= CLOSE * size)
