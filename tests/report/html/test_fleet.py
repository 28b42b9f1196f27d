"""The page and the files of a fleet."""

from __future__ import annotations

import os
import resource
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.fleet.odd import Oddity
from scara_ident.fleet.table import fleet_table
from scara_ident.report.html.fleet import fleet_report, write_fleet
from tests.report.html.document import data_of, document
from tests.report.html.made_fleet import made_fleet


def test_the_arm_that_changed_comes_first_with_what_and_since_when(fleet_page):
    page = document(fleet_page)
    assert page.wrong == []
    assert page.sections == ["arms", "time", "quantities", "faults"]
    assert "1 of 3 arms changed by more than noise." in page.words
    assert "arm2: Coulomb friction of joint2 up 31 % (± 2 %) since 15 February 2026." in page.words
    assert page.words.index("arm2") < page.words.index("arm1")
    assert "arm2/x.csv: <not> whole" in page.words


def test_an_arm_that_is_unlike_others_is_said_to_be_so_behind_what_changed(tmp_path):
    fleet, odd = made_fleet(), Oddity("a01", "Coulomb friction of joint1", "N m", 1.9, 1.02, 12.4, 8)
    first, *others = fleet.arms
    found = replace(fleet, arms=(replace(first, odd=(odd,) * 5), *others))
    assert [item.arm for item in found.ranked] == ["arm2", "arm1", "arm3"]
    fleet_report(tmp_path / "report.html", found)
    words = document(tmp_path / "report.html").words
    said = "On its first date a01 (Coulomb friction of joint1) is 1.9 N m, 12 standard deviations above the median of 8 arms, 1.02"
    assert f"arm1: {said}." in words and "arm1: So are 2 more parameters." in words
    column = fleet_table(found).filter(arm="arm1")["odd"].unique().to_list()
    assert column == ["; ".join([said] * 3 + ["So are 2 more parameters"])]
    assert fleet_table(fleet)["odd"].null_count() == len(fleet_table(fleet))


def test_notes_on_dates_are_in_the_verdict(tmp_path):
    fleet_report(
        tmp_path / "report.html", replace(made_fleet(), notes=("arm1/2026-02-30/x_1.csv: there is no such date",))
    )
    page = document(tmp_path / "report.html")
    assert "arm1/2026-02-30/x_1.csv: there is no such date." in page.words


def test_every_quantity_is_drawn_with_its_bars_for_every_arm(fleet_page):
    fleet = made_fleet()
    figures = data_of(fleet_page)["figures"]
    plots = [plot for figure in figures.values() for plot in figure["variants"].values()]
    told = [{one.name for each in dates for one in each if np.isfinite(one.std)} for dates in fleet.quantities.values()]
    assert len(plots) == sum(map(len, told))
    assert all(any("e" in layer for layer in plot["panels"][0]["layers"]) for plot in plots)
    # The quantity that changed is the first of its joint.
    changed = figures["time-0"]["variants"]["0,1"]["panels"][0]
    assert changed["label"].startswith("a02")
    assert {layer.get("c") for layer in changed["layers"]} == {"grey", "blue", "vermillion"}


def test_a_file_that_would_be_the_same_is_left_alone(tmp_path):
    fleet = made_fleet()
    table = fleet_table(fleet)
    write_fleet(tmp_path, fleet, table)
    for name in ("fleet.parquet", "report.html"):
        os.utime(tmp_path / name, (0, 0))
    write_fleet(tmp_path, fleet, table)
    assert {path.name: path.stat().st_mtime for path in tmp_path.iterdir()} == {"fleet.parquet": 0, "report.html": 0}
    write_fleet(tmp_path, fleet, table.head(1))
    assert (tmp_path / "fleet.parquet").stat().st_mtime > 0 and (tmp_path / "report.html").stat().st_mtime == 0


def test_a_table_that_does_not_fit_leaves_the_earlier_files_and_one_line(tmp_path):
    fleet = made_fleet()
    (tmp_path / "fleet.parquet").write_text("earlier")
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, usual[1]))
    try:
        with pytest.raises(ScaraIdentError, match="give another folder") as caught:
            write_fleet(tmp_path, fleet, fleet_table(fleet))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert str(tmp_path) in str(caught.value) and "\n" not in str(caught.value)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("fleet.parquet", "earlier")]
