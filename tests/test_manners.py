"""Every public result: one short line, a copy of itself, and nothing that can be changed."""

from __future__ import annotations

import copy
import inspect
import pickle
import sys
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import scara_ident
from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.manners import Reported, listed, several
from tests.results import Results

# Families of effects are no results; each is equal to any other of its class.
PUBLIC = sorted(
    name
    for name in scara_ident.__all__
    if inspect.isclass(kind := getattr(scara_ident, name)) and is_dataclass(kind) and not inspect.isabstract(kind)
)


def within(thing: Any, seen: dict[int, Any]) -> dict[int, Any]:
    """All that a result is made of, itself included."""
    if id(thing) in seen:
        return seen
    seen[id(thing)] = thing
    parts: list[Any] = []
    if is_dataclass(thing) and not isinstance(thing, type):
        parts = [getattr(thing, field.name) for field in fields(thing)]
    elif isinstance(thing, tuple | list):
        parts = list(thing)
    elif isinstance(thing, Mapping):
        parts = list(thing.values())
    for part in parts:
        within(part, seen)
    return seen


@pytest.fixture(scope="module")
def examples(results: Results) -> dict[str, Any]:
    """One thing of every public class, found in the results."""
    seen: dict[int, Any] = {}
    motion = results.identification.training.data.stretches[0].motion
    residuals = results.identification.training.residuals(results.identification.estimate.value)
    within((results, motion, residuals, scara_ident.ConsistentOptions()), seen)
    return {type(thing).__name__: thing for thing in reversed(seen.values())}


def same(one: Any, other: Any) -> bool:
    """Whether two things have the same content; arrays bit by bit."""
    if isinstance(one, np.ndarray):
        return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))
    if is_dataclass(one):
        return type(one) is type(other) and all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return one == other or (one != one and other != other)
    # A mapping may have the motions of recordings as its keys, which are equal to themselves only.
    return isinstance(one, Mapping) or type(one).__eq__ is object.__eq__ or one == other


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_result_is_short_copied_and_sent(name: str, examples: dict[str, Any]):
    thing = examples[name]
    line = repr(thing)
    assert line.startswith(f"{name}(")
    assert len(line) < 200
    assert "\n" not in line
    for other in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing)):
        assert other is not thing
        assert same(thing, other)
        assert repr(other) == line


@pytest.mark.parametrize("name", PUBLIC)
def test_no_public_result_can_be_changed(name: str, examples: dict[str, Any]):
    thing = examples[name]
    for held in (thing, copy.deepcopy(thing)):
        first = fields(held)[0].name
        with pytest.raises(FrozenInstanceError):
            setattr(held, first, None)
        for value in (getattr(held, field.name) for field in fields(held)):
            assert not (isinstance(value, np.ndarray) and value.flags.writeable)
            assert not isinstance(value, dict)


def test_an_array_that_a_user_gave_stays_the_users(results: Results):
    time, position = np.arange(10.0), np.zeros((2, 10))
    made = scara_ident.Recording("a", "a", 1, results.robot.joints, time, position)
    position[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        made.position[0, 0] = 2.0


def test_a_copy_works_out_again_what_it_had_kept(results: Results):
    found = results.consistent
    assert found.physical_consistency.possible
    other = copy.deepcopy(found)
    assert "physical_consistency" not in vars(other)
    assert other.physical_consistency.possible
    assert isinstance(found.noise, MappingProxyType)


def test_a_long_line_is_cut_and_nothing_given_is_left_out(results: Results):
    line = repr(results.runs[0].motion), repr(results.design)
    assert all(len(each) < 5000 for each in line)
    assert repr(scara_ident.ConsistentOptions(total_mass=(1.0, 0.1))) == (
        "ConsistentOptions(friction='auto', speed=0 entries, total_mass=2 items, link_mass=0 entries, com='free', "
        "priors=0 entries, prior_weight=0.01)"
    )
    many = scara_ident.Motion("a" * 100, "b" * 300, np.arange(3.0), *[np.zeros((2, 3))] * 3, None, 1.0)
    assert len(repr(many)) < 200
    assert "q=array of 2 x 3" in repr(many)


def test_a_frame_is_of_polars_or_of_pandas(results: Results, monkeypatch: pytest.MonkeyPatch):
    found = results.identification
    polars = found.to_frame()
    assert polars["name"].to_list() == list(found.model.names)
    assert polars["value"].to_list() == found.estimate.value.tolist()
    pandas = pytest.importorskip("pandas")
    other = found.to_frame("pandas")
    assert isinstance(other, pandas.DataFrame)
    assert other["std"].tolist() == found.estimate.std.tolist()
    with pytest.raises(UsageError, match="expected 'polars' or 'pandas'"):
        found.to_frame("numpy")  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match="pip install pandas"):
        found.to_frame("pandas")


def test_a_notebook_has_the_line_and_the_table(results: Results):
    page = results.identification._repr_html_()
    assert page.startswith("<p>Identification(scara03, complete by wls: 15 parameters from 2 recordings)</p><table>")
    assert page.count("<tr>") == 16
    assert "more rows" in results.runs[0].recording._repr_html_()


def test_a_figure_touches_no_pyplot(results: Results):
    for result in (results.identification, results.comparison, results.runs[0]):
        assert isinstance(result, Reported)
        assert result.plot().axes
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


def test_a_result_is_saved_whole_or_not_at_all(results: Results, tmp_path):
    results.comparison.save(tmp_path / "comparison.json")
    assert '"trajectories"' in (tmp_path / "comparison.json").read_text()
    with pytest.raises(ScaraIdentError, match="cannot be written"):
        results.comparison.save(tmp_path / "comparison.json" / "below.json")


def test_words_agree_with_their_number_and_lists_are_short():
    assert [several(k, "recording") for k in (0, 1, 2)] == ["0 recordings", "1 recording", "2 recordings"]
    assert listed(["a", "b", "c", "d", "e"], 3) == "a, b, c and 2 more"
    assert listed(["a", "b"], 3, " and ") == "a and b"
    assert listed(["a"], 3) == "a"
    assert listed([], 3) == ""
