"""Channels that were sampled apart, as the joints of a torso and of an arm in messages of their own, on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import listed, several
from scara_ident.recording.audit import Finding
from scara_ident.recording.audit.clock import MIN_SAMPLES
from scara_ident.recording.audit.samples import GAP_STEPS

# Channels whose rows are the same but for this share were sampled together, and what lacks in one of them is a fault.
SAME_ROWS_SHARE = 0.5


def on_one_clock(
    columns: Mapping[str, Array], time: str, wanted: Sequence[str], beside: Sequence[str] = ()
) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """Put channels onto the clock of those that most of them share.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (N,)
        NaN where a row holds other channels.
    time : str
        Column of the clock.
    wanted : sequence of str
        Channels that are needed together.
    beside : sequence of str
        Channels that may lack: they take no part in the choice of the clock, and NaN stands in their gaps.

    Returns
    -------
    columns : dict of str to ndarray, shape (M,)
        Of the rows that hold the most channels. The others' values stand beside them where they have the same time, and
        are interpolated where they have not, by Hermite's cubic with slopes of second-order differences. Rows that lie
        in a gap of another channel that is needed are left out, and those up to a step before or behind all of another
        channel.
    findings : tuple of Finding
        One where something was interpolated, or one that only says that messages were joined.
    """
    here = {name: np.isfinite(columns[name]) for name in (*wanted, *beside)}
    groups = [
        names for names in _groups({name: here[name] for name in wanted}) if any(here[name].any() for name in names)
    ]
    if not groups:
        return dict(columns), ()
    clock = max(groups, key=lambda names: (len(names), -int(here[names[0]].sum())))
    rows = np.any([here[name] for name in clock], axis=0)
    result = {name: values[rows] for name, values in columns.items()}
    keep = np.ones(int(rows.sum()), dtype=bool)
    apart = [names for names in groups if names is not clock]
    lacking = [
        names
        for names in _groups({name: here[name] for name in beside if here[name].any()})
        if not _together(here[names[0]], rows)
    ]
    resampled: list[str] = []
    for names in (*apart, *lacking):
        own = np.any([here[name] for name in names], axis=0)
        stamps, first = np.unique(columns[time][own], return_index=True)
        for name in names:
            values, exact, inside = _at(result[time], stamps, columns[name][own][first])
            result[name] = np.where(inside, values, np.nan)
            # One that may lack cuts no more rows than another phase of the same clock costs it at its ends.
            keep &= inside if names in apart else inside | ~_at_ends(result[time], stamps)
            if not exact:
                resampled.append(name)
    if not keep.all():
        result = {name: values[keep] for name, values in result.items()}
    return result, _findings(1 + len(apart) + len(lacking), clock, resampled, int(np.count_nonzero(~keep)))


def sparse_channel(columns: Mapping[str, Array], wanted: Sequence[str]) -> str | None:
    """Say which channel holds next to no numbers beside one that holds enough, as a command that is logged when it changes.

    Returns
    -------
    str or None
        None where all hold enough, or none does.
    """
    held = {name: int(np.count_nonzero(np.isfinite(columns[name]))) for name in wanted}
    least, most = min(held, key=held.__getitem__), max(held.values())
    if not 0 < held[least] < MIN_SAMPLES <= most:
        return None
    return (
        f"column {least!r} has a number in {several(held[least], 'row')}, others in {most}; at least {MIN_SAMPLES} "
        "are needed: log it at a fixed rate, and not only when it changes"
    )


def _groups(here: Mapping[str, NDArray[np.bool_]]) -> list[list[str]]:
    """Gather the channels that stand in the same rows."""
    groups: list[list[str]] = []
    for name, rows in here.items():
        for group in groups:
            if _together(rows, here[group[0]]):
                group.append(name)
                break
        else:
            # What is empty throughout is refused by the audit, beside the others.
            groups.append([name]) if rows.any() or not groups else groups[0].append(name)
    return groups


def _together(rows: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    return bool(np.count_nonzero(rows & other) >= SAME_ROWS_SHARE * max(1, min(rows.sum(), other.sum())))


def _at(time: Array, stamps: Array, values: Array) -> tuple[Array, bool, NDArray[np.bool_]]:
    """Return values at other times, whether none had to be interpolated, and which times lie in no gap."""
    if len(stamps) < 2:
        return np.full(len(time), np.nan), False, np.ones(len(time), dtype=bool)
    place = np.clip(np.searchsorted(stamps, time), 0, len(stamps) - 1)
    if np.array_equal(stamps[place], time):
        return values[place], True, np.ones(len(time), dtype=bool)
    left = np.clip(np.searchsorted(stamps, time, side="right") - 1, 0, len(stamps) - 2)
    step = stamps[left + 1] - stamps[left]
    inside = (time >= stamps[0]) & (time <= stamps[-1]) & (step <= GAP_STEPS * np.median(np.diff(stamps)))
    slope = np.gradient(values, stamps)
    share = (time - stamps[left]) / step
    low, high = values[left], values[left + 1]
    rise = share**2 * (3.0 - 2.0 * share)
    bend = step * share * (1.0 - share) * ((1.0 - share) * slope[left] - share * slope[left + 1])
    return low + (high - low) * rise + bend, False, inside


def _at_ends(time: Array, stamps: Array) -> NDArray[np.bool_]:
    """Tell which times lie before the first or behind the last of others by no more than a step of theirs."""
    step = np.median(np.diff(stamps)) if len(stamps) > 1 else 0.0
    before, behind = stamps[0] - time, time - stamps[-1]
    found: NDArray[np.bool_] = ((before > 0) & (before <= step)) | ((behind > 0) & (behind <= step))
    return found


def _findings(groups: int, clock: Sequence[str], resampled: Sequence[str], lost: int) -> tuple[Finding, ...]:
    if groups < 2:
        return ()
    if not resampled:
        said = f"{groups} groups of channels are in separate rows with the same times: joined"
        return (Finding("joined", said, groups),)
    cut = f"; {several(lost, 'row')} in gaps of theirs left out" if lost else ""
    said = f"{listed(resampled, 3)} were sampled apart from {clock[0]}: interpolated onto its clock{cut}"
    return (Finding("resampled", said, len(resampled)),)
