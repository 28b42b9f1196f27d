"""What is held comes back bit for bit; what is not whole is nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scara_ident.fleet.folder import Fault
from scara_ident.fleet.store import Store, key_of, reference_bytes


def test_a_visit_comes_back_bit_for_bit(histories, tmp_path: Path):
    store = Store(tmp_path / "cache")
    fault = Fault("arm1", "2026-01-01", "x.csv", "not whole")
    visit = replace(histories[0].visits[1], faults=(fault,))
    assert store.visit("key") is None
    store.put_visit("key", visit)
    held = store.visit("key")
    assert held is not None
    for name in ("value", "std", "error", "rows"):
        np.testing.assert_array_equal(getattr(held, name), getattr(visit, name))
    for one, other in zip((*held.columns, *held.factors), (*visit.columns, *visit.factors), strict=True):
        np.testing.assert_array_equal(one, other)
    assert held.faults == (fault,)
    assert reference_bytes(held.reference) == reference_bytes(visit.reference)
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["key.npz"]


def test_what_is_not_whole_is_done_again(histories, tmp_path: Path):
    store = Store(tmp_path)
    store.put_visit("key", histories[0].visits[0])
    whole = (tmp_path / "key.npz").read_bytes()
    for content in (b"", whole[: len(whole) // 2], b"x" * 100):
        (tmp_path / "key.npz").write_bytes(content)
        assert store.visit("key") is None
    (tmp_path / "key.json").write_text("{")
    assert store.content("key") is None
    store.put_content("key", {"a": 1})
    assert store.content("key") == {"a": 1}


def test_a_key_tells_where_one_part_ends_and_the_next_begins():
    assert key_of("ab", "c") != key_of("a", "bc")
    assert key_of("ab", "c") == key_of(b"ab", b"c")
