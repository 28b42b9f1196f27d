"""Open lists: what is built in under a name, and what installed packages add to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import cache, cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast
from warnings import warn

from scara_ident.errors import PluginWarning, ScaraIdentError, UsageError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

T = TypeVar("T")


class Registry(Generic[T]):
    """Things of one kind by their names; each is loaded when it is asked for.

    An installed package adds to the list by an entry point of the list's group::

        [project.entry-points."scara_ident.estimators"]
        ridge = "my_package.ridge:ridge"

    A name of the built-in things stays theirs. A package that cannot be imported harms only who asks for what it adds.

    Parameters
    ----------
    kind : str
        What the things are, for messages: ``"method"``.
    group : str
        Group of the entry points: ``"scara_ident.estimators"``.
    built_in : mapping of str to T or str
        The things, or where they are: ``"module"`` or ``"module:attribute"``.
    made_of : callable, optional
        Makes a thing of what a package names; raises `TypeError` where that is not possible.

    Examples
    --------
    >>> shapes = Registry("shape", "scara_ident.no_such_group", {"number": "math:pi", "round": 3.0})
    >>> shapes.names()
    ('number', 'round')
    >>> shapes.get("round")
    3.0
    """

    def __init__(
        self,
        kind: str,
        group: str,
        built_in: Mapping[str, T | str],
        made_of: Callable[[Any], T] = lambda found: cast(T, found),
    ) -> None:
        self.kind = kind
        self.group = group
        self._built_in = dict(built_in)
        self._made_of = made_of

    def names(self) -> tuple[str, ...]:
        """List the names: built-in ones in their order, then those of packages, sorted."""
        return (*self._built_in, *sorted(self._installed.keys() - self._built_in.keys()))

    def check(self, name: str) -> str:
        """Return a name that is known, without loading what it stands for.

        Raises
        ------
        UsageError
            In one line that lists the names.
        """
        if name not in self._built_in and name not in self._installed:
            near = get_close_matches(name, self.names(), n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise UsageError(f"{self.kind} {name!r}: {hint}expected one of {', '.join(self.names())}")
        return name

    def get(self, name: str) -> T:
        """Return what a name stands for.

        Raises
        ------
        UsageError
            If the name is not known; the message lists the names.
        ScaraIdentError
            If several packages use the name, or the package that does cannot be imported; the message names them.

        Warns
        -----
        PluginWarning
            If a package uses a name that is built in.
        """
        points = self._installed.get(self.check(name), [])
        owners = " and ".join(_owner(point) for point in points)
        if name in self._built_in:
            if points:
                warn(f"{self.kind} {name!r} of {owners} is not used: the name is built in", PluginWarning, stacklevel=2)
            return self._load(name)
        if len(points) > 1:
            raise ScaraIdentError(f"{self.kind} {name!r} is in {owners}; uninstall one of them")
        try:
            return self._made_of(points[0].load())
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise ScaraIdentError(
                f"{self.kind} {name!r} of {owners} cannot be loaded ({reason}); update or uninstall it"
            ) from error

    def all(self) -> dict[str, T]:
        """Return all things by name; those that `get` cannot give are left out.

        Warns
        -----
        PluginWarning
            For every one that is left out.
        """
        found = {}
        for name in self.names():
            try:
                found[name] = self.get(name)
            except ScaraIdentError as error:
                warn(str(error), PluginWarning, stacklevel=2)
        return found

    def refresh(self) -> None:
        """Look again at what is installed, as after an installation into a running Python."""
        _scanned.cache_clear()
        self.__dict__.pop("_installed", None)

    def _load(self, name: str) -> T:
        thing = self._built_in[name]
        if not isinstance(thing, str):
            return thing
        module, _, attribute = thing.partition(":")
        loaded: Any = import_module(module)
        return cast(T, getattr(loaded, attribute) if attribute else loaded)

    @cached_property
    def _installed(self) -> dict[str, list[EntryPoint]]:
        found: dict[str, list[EntryPoint]] = {}
        for point in _scanned().select(group=self.group):
            found.setdefault(point.name, []).append(point)
        return found


@cache
def _scanned() -> EntryPoints:
    """Return what is installed, looked for once for all lists: it takes longer than loading the program's own help."""
    from importlib.metadata import entry_points

    return cast("EntryPoints", entry_points())


def _owner(point: EntryPoint) -> str:
    return f"the package {point.dist.name}" if point.dist is not None else point.value


def package_of(error: BaseException) -> str | None:
    """Return the package that adds to this one and in whose code an error arose; None where it is no such package's."""
    everything = _scanned()
    points = (
        point
        for group in everything.groups
        if group.startswith("scara_ident.")
        for point in everything.select(group=group)
    )
    owners = {point.module.partition(".")[0]: _owner(point) for point in points}
    found, trace = None, error.__traceback__
    while trace is not None:
        module = str(trace.tb_frame.f_globals.get("__name__", "")).partition(".")[0]
        found = owners.get(module, found) if module != "scara_ident" else found
        trace = trace.tb_next
    return found
