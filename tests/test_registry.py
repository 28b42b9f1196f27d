"""Registries: built-in things, those of packages, and packages that are broken or use a name that is taken."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from scara_ident.effects import EFFECTS
from scara_ident.errors import PluginWarning, ScaraIdentError, UsageError
from scara_ident.identification import ESTIMATORS
from scara_ident.model import MODELS
from scara_ident.recording.files import IMPORTERS
from scara_ident.registry import Registry, package_of
from tests.plugins.made import make_installed

GROUP = "scara_ident.shapes"


@pytest.fixture
def shapes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Registry[float]]:
    monkeypatch.syspath_prepend(tmp_path)
    make_installed(
        tmp_path, "stars", GROUP, {"star": "stars:AREA", "round": "stars:AREA", "twin": "stars:AREA"}, "AREA = 5.0\n"
    )
    make_installed(tmp_path, "twins", GROUP, {"twin": "twins:AREA"}, "AREA = 2.0\n")
    make_installed(tmp_path, "broken", GROUP, {"cracked": "broken:AREA"}, "import no_such_library\n")
    make_installed(tmp_path, "hollow", GROUP, {"empty": "hollow:AREA"})
    made: Registry[float] = Registry("shape", GROUP, {"round": 3.0, "number": "math:pi"})
    # What is installed may have been looked for before, and shall be again by who comes after.
    made.refresh()
    yield made
    made.refresh()


def test_the_names_are_the_built_in_ones_and_then_those_of_packages(shapes: Registry[float]):
    assert shapes.names() == ("round", "number", "cracked", "empty", "star", "twin")
    assert not {"stars", "broken"} & set(sys.modules)


def test_what_a_package_adds_is_loaded_when_it_is_asked_for(shapes: Registry[float]):
    assert shapes.get("star") == 5.0
    assert shapes.get("number") == pytest.approx(3.14159265, abs=1e-8)


def test_an_unknown_name_is_bad_usage_and_lists_the_others(shapes: Registry[float]):
    with pytest.raises(
        UsageError,
        match=r"shape 'rond': did you mean round\? expected one of round, number, cracked, empty, star, twin$",
    ):
        shapes.get("rond")


def test_a_built_in_name_stays_built_in_and_the_package_is_named(shapes: Registry[float]):
    with pytest.warns(PluginWarning, match="'round' of the package stars is not used"):
        assert shapes.get("round") == 3.0


def test_a_name_of_two_packages_is_refused_with_both(shapes: Registry[float]):
    with pytest.raises(
        ScaraIdentError, match=r"'twin' is in the package .* and the package .*; uninstall one"
    ) as caught:
        shapes.get("twin")
    assert "stars" in str(caught.value)
    assert "twins" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "package", "reason"),
    [("cracked", "broken", "no_such_library"), ("empty", "hollow", "AttributeError")],
)
def test_a_package_that_cannot_be_imported_is_named(shapes: Registry[float], name: str, package: str, reason: str):
    with pytest.raises(
        ScaraIdentError, match=f"'{name}' of the package {package} cannot be loaded .*{reason}"
    ) as caught:
        shapes.get(name)
    assert "\n" not in str(caught.value)


def test_of_all_those_that_cannot_be_given_are_left_out_with_a_warning(shapes: Registry[float]):
    with pytest.warns(PluginWarning) as caught:
        found = shapes.all()
    assert found.keys() == {"round", "number", "star"}
    assert sorted(str(item.message).split()[1] for item in caught) == ["'cracked'", "'empty'", "'round'", "'twin'"]


@pytest.mark.parametrize("registry", [MODELS, ESTIMATORS, IMPORTERS, EFFECTS], ids=lambda registry: registry.kind)
def test_everything_built_in_is_there(registry: Registry[object]):
    ours = set(registry.names()) - {point.name for point in entry_points(group=registry.group)}
    assert len(ours) >= 3
    for name in ours:
        assert registry.get(name) is not None


def test_an_error_in_a_packages_code_names_it(shapes: Registry[float], tmp_path: Path):
    """A fault of somebody's own effect was an internal error of ours, to be reported."""
    make_installed(tmp_path, "moons", GROUP, {"moon": "moons:area"}, "def area(inner):\n    return inner()\n")
    shapes.refresh()
    area: Callable[[Callable[[], float]], float] = shapes.get("moon")  # type: ignore[assignment]

    def fails() -> float:
        raise ZeroDivisionError

    for inner in (fails, lambda: 1 // 0):
        with pytest.raises(ZeroDivisionError) as caught:
            area(inner)
        assert package_of(caught.value) == "the package moons"
    with pytest.raises(ZeroDivisionError) as caught:
        fails()
    assert package_of(caught.value) is None
