"""Columns that belong together: one quantity of the joints of an arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scara_ident.calling import asked_for
from scara_ident.inspection.chain import numbered_joints
from scara_ident.inspection.names import ANGLE, Meaning, meaning
from scara_ident.manners import several
from scara_ident.robot.robot import Robot
from scara_ident.robot.units import table_of

# What a note says between a signal and the number of its channels, by which such notes are recognised, and of several.
SHORT, EACH = " has ", " each have "


@dataclass(frozen=True)
class Signal:
    """The columns of one quantity, by the index of the URDF's joint.

    Attributes
    ----------
    template : str
        The columns with the joint or its number as a placeholder.
    first_number : int or None
        Number of the first joint's column where joints are numbered; None where they are named.
    units : dict of int to str
        Unit of each joint's column; empty where it is not known.
    side : {"joint", "motor"}
        Side of the gear that the numbers belong to.
    """

    quantity: str
    columns: Mapping[int, str]
    template: str
    first_number: int | None
    units: Mapping[int, str] = field(default_factory=dict)
    side: str = "joint"

    @property
    def pattern(self) -> str:
        """The template as a robot description has it, where numbers that begin with 0 are an index."""
        return pattern_of(self.template, self.first_number)


def pattern_of(template: str, first_number: int | None) -> str:
    """Return a template as a robot description has it."""
    return template.replace("{number}", "{index}") if first_number == 0 else template


def of_other_kind(said: Meaning, quantity: str, slides: bool) -> bool:
    """Tell whether a name is of a joint that turns where this one slides, or the other way round."""
    if quantity not in ("position", "velocity"):
        return False
    if slides and said.words & ANGLE:
        return True
    return said.unit is not None and (said.unit in table_of(quantity, linear=slides)) < (
        said.unit in table_of(quantity, linear=not slides)
    )


def groups(quantity: str, meanings: Mapping[str, Meaning], joints: int) -> list[tuple[str, bool, dict[int, str]]]:
    """List the columns that may be one signal: their template, whether joints are named, and the columns.

    What names joints may number them too: where columns count J0, J1 and joints j1, j2, names mislead. Columns that
    differ in their units alone are one signal, unless a joint has two of them.
    """
    named: dict[str, dict[int, str]] = {}
    numbered: dict[str, dict[int, str]] = {}
    stems: dict[str, str] = {}
    for name, said in meanings.items():
        if said.quantity != quantity or (said.joint is not None and said.joint >= joints):
            continue
        if said.joint is not None:
            named.setdefault(said.template, {})[said.joint] = name
        blind = said if said.joint is None else meaning(name)
        stems |= {said.template: said.stem, blind.template: blind.stem}
        # An arm of one joint needs neither name nor number.
        if blind.number is not None or said.joint is None:
            numbered.setdefault(blind.template, {})[blind.number or 0] = name
    return [(template, True, members) for template, members in _over_units(named, stems).items()] + [
        (template, False, members) for template, members in _over_units(numbered, stems).items()
    ]


def _over_units(found: Mapping[str, dict[int, str]], stems: Mapping[str, str]) -> dict[str, dict[int, str]]:
    """Join groups of other joints whose templates are the same but for the unit, under the first one's template."""
    result: dict[str, dict[int, str]] = {}
    first: dict[str, str] = {}
    for template, members in found.items():
        known = first.setdefault(stems[template], template)
        if known != template and not result[known].keys() & members.keys():
            result[known] |= members
        else:
            result[template] = dict(members)
    return result


def short_together(notes: Sequence[str]) -> list[str]:
    """Return notes in which those on signals with too few channels, or with others than the arm's, are one for each number."""
    found: dict[str, list[str]] = {}
    for note in notes:
        signal, has, said = note.partition(SHORT)
        found.setdefault(has + said, []).append(signal)
    others = found.pop("", [])
    return others + [
        signals[0] + said if len(signals) == 1 else ", ".join(signals) + said.replace(SHORT, EACH, 1)
        for said, signals in found.items()
    ]


def of_group(
    quantity: str, template: str, by_name: bool, members: Mapping[int, str], robot: Robot
) -> tuple[Signal | None, str]:
    """Return the signal of a group, if it has enough channels, and what there is to say of it."""
    if by_name:
        return Signal(quantity, dict(sorted(members.items())), template, None), ""
    numbered = sorted(members)
    first = numbered[0]
    pattern = pattern_of(template, first)
    joints = None if numbered != list(range(first, first + len(numbered))) else numbered_joints(robot, len(numbered))
    if joints is None:
        return None, (
            f"{quantity} {pattern}{SHORT}{several(len(numbered), 'channel')} for {robot.n} joints: not used without a mapping; "
            f"name the joints that are in the file, in {asked_for('--joints')}"
        )
    note = ""
    if len(numbered) > robot.n:
        note = f"{quantity}: {pattern} has {len(numbered)} channels; the first {robot.n} taken, in the joints' order"
    elif robot.n > 1:
        note = f"{quantity}: {pattern} matched to the joints by order; check it"
    return Signal(quantity, {k: members[first + place] for place, k in enumerate(joints)}, template, first), note
