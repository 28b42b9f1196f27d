"""The outcome of the checks: short rows that print as a table and write as JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

# Of the SCARA that the paper is about.
JOINTS = ("joint1", "joint2")


@dataclass(frozen=True)
class Subject:
    """What a check is about.

    Attributes
    ----------
    section : str
        What the check belongs to; rows of one section follow each other.
    trajectory, joint : str
        Empty where the check concerns no single one.
    unit : str
        "1" where there is none.
    """

    section: str
    quantity: str
    trajectory: str = ""
    joint: str = ""
    unit: str = "1"


@dataclass(frozen=True, kw_only=True)
class Check(Subject):
    """One printed figure, or one law that printed figures must obey, against what is computed.

    Attributes
    ----------
    condition : str
        What must hold: "equal", or a relation of "printed" and "computed". Empty for information only.
    printed : float or None
        As in the paper; None where the paper prints no such figure.
    computed : float
        What is computed, or the bound that the printed figure is held against.
    relative_difference : float or None
        (computed - printed) / abs(printed); None where either is missing or 0.
    tolerance : float or None
        Allowed relative difference; None for inequalities and information.
    agrees : bool or None
        Whether the condition holds; None for information only.
    comment : str
        One short sentence or empty.
    """

    condition: str = ""
    printed: float | None
    computed: float
    relative_difference: float | None
    tolerance: float | None = None
    agrees: bool | None = None
    comment: str


def equality(subject: Subject, printed: float, computed: float, tolerance: float, comment: str = "") -> Check:
    """Return the check that a computed figure equals the printed one within a relative tolerance."""
    check = information(subject, printed, computed, comment)
    difference = check.relative_difference
    agrees = difference is not None and bool(abs(difference) <= tolerance)
    return replace(check, condition="equal", tolerance=float(tolerance), agrees=agrees)


def inequality(
    subject: Subject, condition: str, holds: bool, printed: float | None, computed: float, comment: str = ""
) -> Check:
    """Return the check of a law; ``condition`` says in words what ``holds`` tells."""
    check = information(subject, printed, computed, comment)
    difference = check.relative_difference if computed else None
    return replace(check, condition=condition, relative_difference=difference, agrees=bool(holds))


def information(subject: Subject, printed: float | None, computed: float, comment: str = "") -> Check:
    """Return a figure that stands beside the printed one without a judgement."""
    difference = None if not printed else float((computed - printed) / abs(printed))
    return Check(
        **vars(subject), printed=printed, computed=float(computed), relative_difference=difference, comment=comment
    )


@dataclass(frozen=True)
class SectionCount:
    """How many rows of a section agree, differ, or only inform."""

    section: str
    agree: int
    differ: int
    information: int


@dataclass(frozen=True)
class PaperReport:
    """All checks of the paper, in the order in which they read best."""

    checks: tuple[Check, ...]

    @property
    def sections(self) -> tuple[str, ...]:
        """Names of the sections in order."""
        return tuple(dict.fromkeys(check.section for check in self.checks))

    def section(self, name: str) -> tuple[Check, ...]:
        """Return the rows of a section; empty for a name that there is not."""
        return tuple(check for check in self.checks if check.section == name)

    def counts(self) -> tuple[SectionCount, ...]:
        """Return a count of agreeing and differing rows per section."""
        marks = {name: [check.agrees for check in self.section(name)] for name in self.sections}
        return tuple(
            SectionCount(name, mine.count(True), mine.count(False), mine.count(None)) for name, mine in marks.items()
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists, strings, numbers and None, for JSON."""
        return {
            "counts": [asdict(count) for count in self.counts()],
            "checks": [asdict(check) for check in self.checks],
        }
