"""The files of a fleet: its table, and its report with arms by their need of a look and every quantity over time."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import NORMAL_MEDIAN
from scara_ident.files import written_together
from scara_ident.fleet import Fleet
from scara_ident.fleet.changes import FALSE_CHANGE_LEVEL
from scara_ident.fleet.fleet import ArmReport
from scara_ident.fleet.odd import FALSE_ODD_LEVEL, FEWEST_ARMS
from scara_ident.manners import several
from scara_ident.report.html.blocks import (
    Block,
    Cell,
    Group,
    Listing,
    Paragraph,
    Selector,
    Table,
    Tag,
    chance,
    name,
    number,
    superscripts,
)
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection, Section
from scara_ident.report.plot import Dots, Drawing, Figure, Layer, Level, Mark, Panel, Plot

if TYPE_CHECKING:
    import polars as pl

TABLE, REPORT = "fleet.parquet", "report.html"
# Pictures of a report at the most; of further arms the table has the numbers.
MAX_PLOTS = 4000
WHOLE_ARM = "the whole arm"
_MOODS = {"changed": "bad", "unchanged": "good"}


def _arms(fleet: Fleet) -> list[Block]:
    """Arms, the most urgent first."""
    rows: list[list[Cell | str]] = []
    for item in fleet.ranked:
        dates = () if item.history is None else item.history.dates
        joined = "; ".join((*item.sentences, *item.oddities))
        surest = min((change.p_value for change in item.changes), default=None)
        rows.append(
            [
                name(item.arm),
                Cell(tag=Tag(item.verdict, _MOODS.get(item.verdict, "plain"))),
                Cell(joined, "words"),
                "–" if surest is None else chance(surest),
                Cell(_diagnosis(item), "words"),
                f"{len(dates)}",
                Cell(dates[-1] if dates else "–", "unit"),
                f"{len(item.faults)}",
            ]
        )
    words = (
        f"An arm is listed if a change is larger than noise: on average a share of {FALSE_CHANGE_LEVEL:g} of the "
        f"listed arms is wrong, and if nothing changed in the fleet the probability that a report lists any arm is "
        f"{FALSE_CHANGE_LEVEL:g}. Noise includes the differences of friction, torque scale, offset and delay from date "
        f"to date, as estimated from the whole fleet. An arm is unlike others if a parameter of its first date lies farther from "
        f"the median of at least {FEWEST_ARMS} arms, in units of the spread between them, than the farthest of normal arms: in "
        f"a fleet without odd arms the probability that a report names any is {FALSE_ODD_LEVEL:g}."
    )
    head = (
        "arm",
        "verdict",
        "what changed, or is unlike others",
        "chance",
        "diagnosis of the last date",
        "dates",
        "last",
        "faults",
    )
    return [Paragraph(words), Table(head, rows, (3, 5, 7))]


def _diagnosis(item: ArmReport) -> str:
    if item.diagnosis is None:
        return ""
    effects = [
        one["description"] + ("" if one["joint"] is None else f" on {one['joint']}")
        for one in item.diagnosis["effects"]
    ]
    return "; ".join([str(item.diagnosis["verdict"]), *effects])


def _over_time(fleet: Fleet) -> list[Block]:
    """Every quantity over time with its uncertainty."""
    shown: list[ArmReport] = []
    plots = 0
    for item in fleet.ranked:
        dates = fleet.quantities.get(item.arm, ())
        plots += len(dates[0]) if dates else 0
        if plots > MAX_PLOTS and shown:
            break
        if dates:
            shown.append(item)
    if not shown:
        return []
    groups = (*fleet.robot.joints, WHOLE_ARM)
    slots: dict[int, dict[tuple[int, ...], Drawing]] = {}
    for a, item in enumerate(shown):
        for g, group in enumerate(groups):
            for slot, plot in enumerate(_plots(fleet, item, None if group == WHOLE_ARM else group)):
                slots.setdefault(slot, {})[a, g] = plot
    figures = [Figure(f"time-{slot}", "", "", variants, (0, 1), quiet=True) for slot, variants in slots.items()]
    words = "Bars are ± 2 standard deviations, including the differences from date to date. Blue: as on the first date; vermillion: since it changed."
    if len(shown) < len(fleet.arms):
        words += f" The {len(shown)} most urgent arms are shown; fleet.parquet has all."
    selectors = (Selector("arm", tuple(item.arm for item in shown)), Selector("of", groups))
    return [Paragraph(words), Group("time-group", figures, selectors, "three")]


def _plots(fleet: Fleet, item: ArmReport, joint: str | None) -> list[Plot]:
    """Return a small plot of each quantity of a joint, those that changed first."""
    dates = fleet.quantities[item.arm]
    by_name = [{one.name: one for one in each} for each in dates]
    first = dict.fromkeys(one.name for one in chain.from_iterable(dates) if one.joint == joint)
    found: list[tuple[bool, Plot]] = []
    for quantity in first:
        known = [(k, each[quantity]) for k, each in enumerate(by_name) if quantity in each]
        known = [(k, one) for k, one in known if np.isfinite(one.value) and np.isfinite(one.std)]
        if not known:
            continue
        since = [change.since for change in item.changes if change.cause and change.cause.label == known[0][1].cause]
        starts = sorted(item.known.dates.index(day) for day in since)
        start = starts[0] if starts else len(dates)
        layers: list[Layer] = [Level(known[0][1].value, "grey")]
        for color, own in (
            ("blue", [pair for pair in known if pair[0] < start]),
            ("vermillion", [pair for pair in known if pair[0] >= start]),
        ):
            if own:
                x, y = np.array([k for k, _ in own], dtype=float), np.array([one.value for _, one in own])
                layers.append(Dots(x, y, color, bar=np.array([2.0 * one.std for _, one in own])))
        layers += [Mark(place - 0.5, "vermillion") for place in dict.fromkeys(starts)]
        unit = known[0][1].unit
        label = quantity if unit == "1" else f"{quantity} [{superscripts(unit)}]"
        plot = Plot("", (Panel(label, layers, 120),), (-0.5, len(dates) - 0.5), small=True, names=item.known.dates)
        found.append((not since, plot))
    return [plot for _, plot in sorted(found, key=lambda pair: pair[0])]


def _faults(fleet: Fleet) -> list[Block]:
    """What could not be used."""
    return [Listing(tuple(str(fault) for fault in fleet.faults))] if fleet.faults else []


def _scatter(fleet: Fleet) -> list[Block]:
    """How well the dates know each quantity."""
    values: dict[str, list[tuple[float, float, str]]] = {}
    for dates in fleet.quantities.values():
        for one in chain.from_iterable(dates):
            if np.isfinite(one.value) and np.isfinite(one.std):
                values.setdefault(one.name, []).append((one.value, one.std, one.unit))
    rows: list[Sequence[Cell | str]] = []
    for quantity, each in values.items():
        numbers = np.array([pair[:2] for pair in each])
        middle, std = np.median(numbers, axis=0)
        spread = float(np.median(np.abs(numbers[:, 0] - middle))) / NORMAL_MEDIAN
        unit = "" if each[0][2] == "1" else superscripts(each[0][2])
        rows.append(
            [name(quantity), number(float(middle)), number(float(std), 2), number(spread, 2), Cell(unit, "unit")]
        )
    words = "Over all arms and dates: the median, its standard deviation on one date, and the spread of arms and dates."
    head = ("quantity", "median", "std of a date", "spread of the fleet", "unit")
    return [Paragraph(words), Table(head, rows, (1, 2, 3))] if rows else []


SECTIONS: tuple[Section, ...] = (
    NamedSection("arms", "Arms, the most urgent first", _arms),
    NamedSection("time", "Over time", _over_time),
    NamedSection("quantities", "The fleet", _scatter),
    NamedSection("faults", "Faults", _faults),
)


def fleet_report(path: Path, fleet: Fleet) -> None:
    """Write the report of a fleet as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    changed = [item for item in fleet.ranked if item.changes]
    verdict = [f"{len(changed)} of {several(len(fleet.arms), 'arm')} changed by more than noise."]
    verdict += [f"{item.arm}: {words}." for item in changed for words in item.sentences]
    verdict += [f"{item.arm}: {words}." for item in fleet.ranked for words in item.oddities]
    if fleet.reservation:
        verdict.append(f"{fleet.reservation}.")
    verdict += [f"{note}." for note in fleet.notes]
    if fleet.faults:
        verdict.append(f"{several(len(fleet.faults), 'fault')}: see below.")
    dates = sum(len(item.history.dates) for item in fleet.arms if item.history is not None)
    Page(
        f"Fleet of {fleet.robot.name}",
        f"{fleet.model.name} model; {several(len(fleet.arms), 'arm')}, {several(dates, 'date')} in all",
        verdict,
        parts("fleet", SECTIONS, fleet),
        warn=bool(changed or fleet.faults or any(item.odd for item in fleet.arms)),
    ).write(path)


def write_fleet(folder: Path, fleet: Fleet, table: pl.DataFrame) -> None:
    """Write the table and the report of a fleet; a file that is there with the same content stays as it is.

    Parameters
    ----------
    table : DataFrame
        See `scara_ident.fleet.table.fleet_table`.

    Raises
    ------
    ScaraIdentError
        In one line, if they cannot be written.
    """
    content = BytesIO()
    table.write_parquet(content)
    with written_together(folder) as place:
        (place / TABLE).write_bytes(content.getvalue())
        fleet_report(place / REPORT, fleet)
        for name in (TABLE, REPORT):
            held = folder / name
            if held.is_file() and held.read_bytes() == (place / name).read_bytes():
                (place / name).unlink()
