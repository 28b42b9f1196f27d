"""Sections of reports: the protocol that all follow, and those that installed packages add."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

from scara_ident.errors import ScaraIdentError
from scara_ident.registry import Registry
from scara_ident.report.html.blocks import Block, Listing

Kind = Literal["identification", "diagnosis", "comparison", "excitation", "paper", "use", "check", "contact", "fleet"]


class Section(Protocol):
    """A part of a report with its place in the table of contents.

    Attributes
    ----------
    id : str
        Unique on the page: letters, digits and hyphens.
    title : str
    """

    @property
    def id(self) -> str:
        """Name on the page."""
        ...

    @property
    def title(self) -> str:
        """Heading."""
        ...

    def build(self, context: Any) -> Sequence[Block]:
        """Return what is drawn of a result.

        Parameters
        ----------
        context : IdentificationContext, DiagnosisContext, ComparisonContext, ExcitationContext, PaperReport,
            UseContext, Check, ContactFindings or Fleet
            By the kind of report.

        Returns
        -------
        sequence of Block
            Nothing where there is nothing to say: the section is then left out.
        """
        ...


@dataclass(frozen=True)
class NamedSection:
    """A section whose content a function builds; see `Section`."""

    id: str
    title: str
    build: Callable[[Any], Sequence[Block]]


def notes_section(notes: Callable[[Any], Sequence[str] | None], title: str = "Notes on the data") -> NamedSection:
    """Return the section of what there is to know, which ``notes`` takes from the context."""
    return NamedSection("notes", title, lambda context: [Listing(tuple(found))] if (found := notes(context)) else [])


@dataclass(frozen=True)
class AddedSection:
    """A section of an installed package, with the kinds of report that it belongs to."""

    section: Any
    kinds: tuple[str, ...]

    @property
    def id(self) -> str:
        """Its id."""
        return str(self.section.id)

    @property
    def title(self) -> str:
        """Its title."""
        return str(self.section.title)

    def build(self, context: Any) -> Sequence[Block]:
        """Return what is drawn of a result; see `Section.build`.

        Raises
        ------
        ScaraIdentError
            In one line that names the section.
        """
        try:
            return tuple(self.section.build(context))
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            name = type(self.section).__name__
            raise ScaraIdentError(
                f"report section {self.id!r} of {name} cannot be built ({reason}); correct it"
            ) from error


def _added(found: Any) -> AddedSection:
    section = found() if isinstance(found, type) else found
    missing = [name for name in ("id", "title", "kinds", "build") if not hasattr(section, name)]
    if missing:
        raise TypeError(f"it has no {' and no '.join(missing)}")
    kinds = (section.kinds,) if isinstance(section.kinds, str) else tuple(section.kinds)
    if wrong := [kind for kind in kinds if kind not in get_args(Kind)]:
        raise TypeError(f"there is no report of kind {wrong[0]}; kinds are {', '.join(get_args(Kind))}")
    return AddedSection(section, kinds)


# A package names an object, or a class to be called without arguments: a `Section` with ``kinds``.
ADDED: Registry[AddedSection] = Registry("report section", "scara_ident.report_sections", {}, _added)


def added_sections(kind: Kind) -> tuple[AddedSection, ...]:
    """Return the sections that installed packages add to a kind of report.

    Parameters
    ----------
    kind : str
        ``identification``, ``diagnosis``, ``comparison``, ``excitation``, ``paper``, ``use``, ``check``,
        ``contact`` or ``fleet``.

    Raises
    ------
    ScaraIdentError
        In one line that names the package, if one cannot be loaded or is no section.
    """
    return tuple(added for added in map(ADDED.get, ADDED.names()) if kind in added.kinds)
