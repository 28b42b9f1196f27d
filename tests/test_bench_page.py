"""The page of speeds says what was measured; how fast anything is, is no test."""

from __future__ import annotations

import json
import sys

import pytest

from tests.shared import ROOT


@pytest.fixture
def bench_page(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    monkeypatch.delitem(sys.modules, "bench_page", raising=False)
    return pytest.importorskip("bench_page", reason="benchmarks are not part of an installed package")


def test_the_page_is_that_of_the_results(bench_page):
    held = json.loads(bench_page.RESULTS.read_text(encoding="utf-8"))
    assert set(held) == set(bench_page.TABLES)
    assert bench_page.PAGE.read_text(encoding="utf-8") == bench_page.page(held)


def test_what_was_not_measured_is_scaled_and_marked(bench_page):
    each = {"seconds": 2.0, "cpu_seconds": 1.0, "extra_mb": 8.0}
    few = {"arm": "A", "samples": 10, "ways": {"loop": each}}
    many = {"arm": "A", "samples": 100, "ways": {}}
    scaled = {"seconds": 20.0, "cpu_seconds": 10.0, "extra_mb": 80.0}
    assert bench_page.cost(few, [few, many], "loop") == (each, "")
    assert bench_page.cost(many, [few, many], "loop") == (scaled, "\\*")
