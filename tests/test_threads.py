"""Two threads over items, and one BLAS thread."""

from __future__ import annotations

import sys
import threading

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from scara_ident import threads
from scara_ident.threads import LONG_ARRAY, SOON, made_once, one_blas_thread, side_by_side, threads_for
from tests.shared import PATIENCE

pytestmark = pytest.mark.usefixtures("two_cores")


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_results_come_in_the_order_of_the_items_whichever_is_done_first():
    first = threading.Event()

    def work(item: int, other: int) -> int:
        if item == 0:
            assert first.wait(PATIENCE)
        else:
            first.set()
        return 10 * item + other

    assert side_by_side(work, range(4), range(4)) == [0, 11, 22, 33]


def test_what_is_done_to_short_arrays_is_done_in_one_thread():
    def names(samples: int) -> set[int]:
        both = threading.Barrier(2)

        def meet(item: int) -> int:
            if samples >= LONG_ARRAY:
                both.wait(PATIENCE)
            return threading.get_ident()

        with threads_for(samples):
            return set(side_by_side(meet, range(2)))

    assert len(names(LONG_ARRAY)) == 2
    assert names(LONG_ARRAY - 1) == {threading.get_ident()}


def test_threads_ask_for_the_interpreter_soon_until_the_last_caller_is_done():
    before = sys.getswitchinterval()
    begun, ended = threading.Event(), threading.Event()

    def later(item: int) -> bool:
        begun.set()
        return ended.wait(PATIENCE)

    other = threading.Thread(target=side_by_side, args=(later, range(2)))
    other.start()
    assert begun.wait(PATIENCE)
    assert side_by_side(lambda _: sys.getswitchinterval(), range(2)) == pytest.approx([SOON] * 2)
    assert sys.getswitchinterval() == pytest.approx(SOON)
    ended.set()
    other.join(PATIENCE)
    assert sys.getswitchinterval() == before > SOON


def test_an_error_reaches_the_caller():
    with pytest.raises(ZeroDivisionError):
        side_by_side(lambda x: 1 / x, [1, 0, 2])


def test_blas_has_one_thread_inside_and_its_own_again_outside():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with one_blas_thread():
            assert blas_threads() == {1}
        assert blas_threads() == before
        assert set().union(*side_by_side(lambda _: blas_threads(), range(3))) == {1}
        with pytest.raises(KeyError), one_blas_thread():
            raise KeyError
        assert blas_threads() == before


def test_what_is_wanted_side_by_side_within_is_done_one_after_the_other():
    def inner(item: int) -> int:
        return threading.get_ident()

    def outer(item: int) -> set[int]:
        return {threading.get_ident(), *side_by_side(inner, range(3))}

    assert all(len(threads) == 1 for threads in side_by_side(outer, range(4)))


def test_of_several_errors_the_first_item_s_is_raised_and_the_next_call_works():
    def fails(item: int) -> int:
        raise ValueError(item)

    with pytest.raises(ValueError, match="0"):
        side_by_side(fails, range(4))
    assert side_by_side(abs, [-1, 2]) == [1, 2]


def test_what_is_made_once_is_made_for_two_instances_at_the_same_time():
    both = threading.Barrier(2)

    class Slow:
        @made_once
        def value(self) -> int:
            """Return what both have to be at work for."""
            both.wait(PATIENCE)
            return id(self)

    slow = [Slow(), Slow()]
    assert side_by_side(lambda item: item.value, slow) == [id(item) for item in slow]
    # A third time nobody would come to the barrier.
    assert slow[0].value == id(slow[0])
    assert Slow.value.__doc__ == "Return what both have to be at work for."


def test_where_there_is_one_core_one_thread_does_all(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(threads, "available_cores", lambda: 1)
    assert set(side_by_side(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}
