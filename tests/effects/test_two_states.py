"""The likeliest states against all there are, and how sure instants are against closed forms."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from scara_ident.effects.two_states import MEMORY, instants, likeliest, scatter_of, spans


@pytest.mark.parametrize("seed", range(5))
def test_the_likeliest_states_are_the_best_of_all(seed: int):
    gains = 2.0 * np.random.default_rng(seed).standard_normal(9)

    def worth(state: tuple[int, ...]) -> float:
        return float(np.sum(gains * state) - 1.5 * np.count_nonzero(np.diff(state)))

    (found,) = likeliest([gains], 1.5)
    assert worth(tuple(found.astype(int))) == pytest.approx(max(map(worth, product((0, 1), repeat=9))))


def test_recordings_of_other_lengths_are_apart():
    rng = np.random.default_rng(1)
    gains = [rng.standard_normal(count) for count in (5, 12, 1)]
    together = likeliest(gains, 0.8)
    for own, state in zip(gains, together, strict=True):
        assert np.array_equal(state, likeliest([own], 0.8)[0])


def test_a_change_may_cost_each_recording_something_else():
    gains = np.random.default_rng(1).standard_normal((3, 40))
    costs = np.array([0.1, 1.0, 3.0])
    for own, cost, state in zip(gains, costs, likeliest(list(gains), costs), strict=True):
        assert np.array_equal(state, likeliest([own], float(cost))[0])


def test_spans_begin_and_end():
    assert spans(np.array([1.0, 0.0, 1.0, 1.0, 0.0, 1.0])) == [(0, 1), (2, 4), (5, 6)]
    assert spans(np.zeros(3)) == []


def test_an_instant_within_what_tells_nothing_is_its_middle():
    """Cells of a tenth of a second; between 2 and 4 s nothing is seen, so that any time there is as likely."""
    bounds = np.linspace(0.0, 10.0, 101)
    gains = np.where(bounds[1:] > 4.01, 50.0, np.where(bounds[:-1] < 1.99, -50.0, 0.0))
    ((start, stop, start_std, stop_std),) = instants(gains, 2.0 * np.abs(gains), likeliest([gains], 5.0)[0], bounds)
    assert start == pytest.approx(3.0)
    assert start_std == pytest.approx(2.0 / 12.0**0.5, rel=0.1)
    assert (stop, stop_std) == (10.0, 0.0)


def test_an_instant_that_cells_tell_is_known_to_a_cell():
    bounds = np.linspace(0.0, 10.0, 101)
    gains = np.where((bounds[:-1] > 2.95) & (bounds[1:] < 7.05), 50.0, -50.0)
    ((start, stop, start_std, stop_std),) = instants(gains, 2.0 * np.abs(gains), likeliest([gains], 5.0)[0], bounds)
    assert (start, stop) == (pytest.approx(3.0, abs=0.002), pytest.approx(7.0, abs=0.002))
    assert start_std == pytest.approx(0.1 / 12.0**0.5) == stop_std


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7])
def test_an_instant_within_a_cell_is_determined_by_how_full_it_is(share: float):
    """Of a cell of size s in which something acts for a share f of it the gain is (f - 1/2) s."""
    bounds = np.linspace(0.0, 10.0, 101)
    acts = np.where(bounds[1:] > 3.05, 1.0, 0.0)
    acts[29] = share
    ((start, *_),) = instants(1e4 * (acts - 0.5), np.full(100, 1e4), np.round(acts), bounds)
    assert start == pytest.approx(3.0 - 0.1 * share, abs=0.001)


def test_scatter_is_one_of_independent_rows_and_larger_of_what_remembers():
    rng, width = np.random.default_rng(2), 0.05
    size = rng.uniform(0.5, 2.0, 20000)
    white = np.sqrt(size) * rng.standard_normal(20000)
    assert scatter_of([white], [size], width) == pytest.approx(1.0, abs=0.1)
    lasting = np.sqrt(size) * np.repeat(rng.standard_normal(2000), 10)
    assert scatter_of([lasting], [size], width) == pytest.approx(MEMORY / width, rel=0.1)
    assert scatter_of([np.zeros(3)], [np.zeros(3)], width) == 1.0
