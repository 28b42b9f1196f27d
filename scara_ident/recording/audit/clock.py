"""Faults of the log itself: missing numbers, the clock, rows that repeat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import GAP_STEPS, Finding, Samples, runs

Checked = tuple[Samples, list[Finding]]

# Fifteen parameters a joint are asked of one equation a joint and sample: fewer than three equations a parameter, after
# a filter has used up both ends, say nothing.
MIN_SAMPLES = 50
# No quantity that a robot records is as large, in any unit: such a number is damage, and overflows when squared.
HUGE = 1e30
# Rows without a number are left out up to this share of the file (or this many in a short one) ...
MISSING_SHARE = 0.01
MISSING_ROWS = 5
# ... and, away from its ends, in runs of at most this many: longer ones are a fault of the log that should be seen.
MISSING_RUN = 10
# Slower than 5 Hz no arm is servoed, faster than 100 kHz none is logged: such a clock does not count seconds.
SLOWEST, FASTEST = 0.2, 1e-5
CLOCKS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
# A robot is usually logged near 500 Hz; of two readings of a clock, the one nearer to this is meant.
USUAL_INTERVAL = 2e-3
# Beyond this share the clock is too coarse, and what is kept would depend on which row came first.
REPEATED_SHARE = 0.05
# On a clock whose steps up to LATE vary by less than STEADY, a step within NEAR (three times that variation, if it is
# more) of two or more whole steps is a sample lost; any other long step is a sample late.
LATE, STEADY, NEAR = 1.5, 0.1, 0.1
# Below this, taking the interval as constant misplaces a position by less than a thirtieth of what it travels a sample.
JITTER = 0.03
# A joint moves where its speed is above this share of its rms speed over the recording.
MOVING = 0.2
# Rows on either side over which that speed is taken: enough for an encoder's steps to average out.
MOVING_ROWS = 3
# Rows that repeat every channel are a hold, not a coincidence of quantised channels, from this share of the moving rows
# on and where most repetitions of the least repetitive channel fall on them.
HELD_SHARE = 0.02
HELD_OF_REPEATS = 0.5
# All channels standing still for longer, and then jumping on, is a logger that stalled.
FREEZE_SECONDS = 0.2
# A jump out of a freeze is this many times longer than the steps beside it; an arm that rested moves off smoothly.
FREEZE_JUMP = 3.0


def enough(samples: Samples) -> Checked:
    """Refuse a recording with too few samples."""
    if samples.count < MIN_SAMPLES:
        samples.refuse(f"{samples.count} usable samples; at least {MIN_SAMPLES} are needed, record for longer")
    return samples, []


def missing_numbers(samples: Samples) -> Checked:
    """Leave out scattered rows in which a needed number is missing or infinite; refuse many."""
    bad = _not_finite(samples)
    if bad is None:
        return samples, []
    column = "time"
    worst = ~_finite(samples.time)
    for name, signal in (("position", samples.position), ("effort", samples.effort)):
        for joint, values in zip(samples.robot.joints, () if signal is None else signal, strict=False):
            here = ~_finite(values)
            if here.sum() > worst.sum():
                column, worst = f"{joint}.{name}", here
    total, of_worst = int(bad.sum()), int(worst.sum())
    first = int(samples.row[np.argmax(worst)])
    what = f"{column} is empty, NaN or infinite in {of_worst} of {samples.count} rows, first in row {first}"
    start, length = runs(bad[1:] & bad[:-1])
    inside = (start > 0) & (start + length < samples.count)
    longest = int(length[inside].max(initial=1))
    if total > max(MISSING_ROWS, MISSING_SHARE * samples.count):
        samples.refuse(f"{what}: too many to leave out; record that channel, or cut the file to where it is")
    if longest > MISSING_RUN:
        samples.refuse(f"{what}, up to {longest} rows in a row; cut the file there, or fill in that channel")
    said = f"{what}: {several(total, 'row')} left out"
    return samples.kept(~bad), [Finding("nan", said, total)]


def clock_unit(samples: Samples) -> Checked:
    """Refuse a time that stands still or does not count seconds."""
    step = np.diff(samples.time)
    step = step[step > 0]
    if not len(step):
        samples.refuse("time never advances; it must be in seconds and grow from row to row")
    median = float(np.median(step))
    if FASTEST <= median <= SLOWEST:
        return samples, []
    fitting = [(n, f) for n, f in CLOCKS if FASTEST <= median / f <= SLOWEST]
    if fitting:
        name, factor = min(fitting, key=lambda item: abs(np.log(median / item[1] / USUAL_INTERVAL)))
        guess = f"it looks like {name}, divide by {factor:g}"
    else:
        guess = "write it in seconds"
    samples.refuse(f"time grows by {median:.4g} a row (median), which is no sampling interval in s: {guess}")


def time_order(samples: Samples) -> Checked:
    """Refuse time that runs backwards; keep the first of the rows that share a time stamp."""
    step = np.diff(samples.time)
    if step.min() > 0:
        return samples, []
    back = np.flatnonzero(step < 0)
    if len(back):
        before, here = int(back[0]), int(back[0]) + 1
        samples.refuse(
            f"time runs backwards at row {samples.row[here]}, from {samples.time[before]:.6g} s to "
            f"{samples.time[here]:.6g} s ({several(len(back), 'time')} in all); "
            "sort the rows by time, or cut the file there"
        )
    repeated = step == 0
    differing = repeated & ~_repeats(samples)
    total, others = int(repeated.sum()), int(differing.sum())
    if others > REPEATED_SHARE * samples.count:
        first = int(np.argmax(differing)) + 1
        samples.refuse(
            f"{others} of {samples.count} rows have the time of the row before and other values, first "
            f"{samples.where(first)}: the clock is too coarse; record time with more digits"
        )
    first = int(np.argmax(repeated)) + 1
    values = f"{others} with other values" if others else "with the same values"
    said = (
        f"time stands still in {several(total, 'row')} ({values}), first in {samples.where(first)}: "
        "the first row of each time kept"
    )
    return samples.kept(np.concatenate(([True], ~repeated))), [Finding("repeated_time", said, total)]


def sampling(samples: Samples) -> Checked:
    """Say how even the clock is, where samples are lost and where the recording has gaps."""
    step = np.diff(samples.time)
    median = float(np.median(step))
    # A step over rows that were left out is none of the clock's.
    step = np.where(step > LATE * median, step - median * (np.diff(samples.row) - 1), step)
    gap = step > GAP_STEPS * median
    late = step > LATE * median
    unsteady = float(np.std(step[~late])) / median
    near = np.abs(step / median - np.rint(step / median)) < max(NEAR, 3 * unsteady)
    lost = late & ~gap & near & (unsteady < STEADY)
    usual = step[~(gap | lost)]
    jitter = float(np.std(usual)) / median
    found = []
    if jitter > JITTER:
        found.append(
            Finding(
                "jitter",
                f"sampling interval varies by {100 * jitter:.2g} % (std), {1e3 * usual.min():.3g} to "
                f"{1e3 * usual.max():.3g} ms about {1e3 * median:.3g} ms: the time stamps are used",
            )
        )
    if lost.any():
        count = int(np.sum(np.rint(step[lost] / median) - 1))
        first = samples.where(int(np.argmax(lost)) + 1)
        said = f"about {several(count, 'single sample')} lost, first before {first}: interpolated"
        found.append(Finding("dropped", said, count))
    if gap.any():
        count, longest = int(gap.sum()), int(np.argmax(np.where(gap, step, 0)))
        missing = int(np.sum(np.rint(step[gap] / median) - 1))
        said = (
            f"{several(count, 'gap')} in time, the longest {step[longest]:.3g} s before "
            f"{samples.where(longest + 1)}; about {missing} samples lost: the recording is cut there"
        )
        found.append(Finding("gap", said, count))
    return samples, found


def held_rows(samples: Samples) -> Checked:
    """Leave out rows that only repeat the row before although the arm moves.

    A logger that is faster than its source repeats whole rows; one that stalls does so for long. Encoders repeat
    themselves at low speed, but noisy efforts do not: without efforts nothing is judged.
    """
    if samples.effort is None:
        return samples, []
    same = _repeats(samples)
    active = np.flatnonzero(~samples.idle())
    if not same.any() or not len(active):
        return samples, []
    fresh = np.flatnonzero(np.concatenate(([True], ~same)))
    if len(fresh) <= 4 * MOVING_ROWS:
        return samples, []
    moving = _moving(samples, active, fresh)

    start, length = runs(same)
    frozen = _frozen(samples, active, fresh, start, length)
    keep = np.ones(samples.count, dtype=bool)
    found = []
    if frozen.any():
        for first, rows in zip(start[frozen], length[frozen], strict=True):
            keep[first + 1 : first + rows] = False
        count, longest = int((~keep).sum()), int(np.argmax(np.where(frozen, length, 0)))
        said = (
            f"every channel stands still {several(int(frozen.sum()), 'time')} while the arm moves, the longest "
            f"{samples.interval * length[longest]:.2g} s from {samples.where(int(start[longest]))}: "
            f"{several(count, 'row')} left out"
        )
        found.append(Finding("freeze", said, count))

    judged = keep[1:] & keep[:-1] & moving[1:] & moving[:-1]
    if judged.any() and _is_hold(samples, same, judged):
        held = np.concatenate(([False], same)) & keep
        count = int(held.sum())
        keep &= ~held
        rate = 1.0 / float(np.median(np.diff(samples.time[keep])))
        first = int(np.argmax(held))
        said = (
            f"{count} of {samples.count} rows repeat the row before in every channel while the arm moves, first "
            f"{samples.where(first)}: left out, the source ran at about {rate:.4g} Hz"
        )
        found.append(Finding("held_samples", said, count))
    return samples.kept(keep), found


def _not_finite(samples: Samples) -> NDArray[np.bool_] | None:
    """Tell which samples lack a number, shape (N,); None where all have theirs, which the extremes tell at once."""
    signals = [samples.time, *_channels(samples)]
    if all(signal.min() > -HUGE and signal.max() < HUGE for signal in signals):
        return None
    bad = np.zeros(samples.count, dtype=bool)
    for signal in signals:
        bad |= ~_finite(signal)
    return bad


def _finite(signal: Array) -> NDArray[np.bool_]:
    finite: NDArray[np.bool_] = np.abs(signal) < HUGE
    return finite


def _repeats(samples: Samples) -> NDArray[np.bool_]:
    """Tell which samples repeat the one before in every channel, shape (N - 1,)."""
    same = np.ones(samples.count - 1, dtype=bool)
    for signal in _channels(samples):
        same &= signal[1:] == signal[:-1]
    return same


def _channels(samples: Samples) -> list[Array]:
    return [*samples.position, *(() if samples.effort is None else samples.effort)]


def _moving(samples: Samples, active: NDArray[np.intp], fresh: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Tell during which samples a joint moves, shape (N,), from the `fresh` samples alone."""
    count = len(fresh)
    after = fresh[np.minimum(np.arange(count) + MOVING_ROWS, count - 1)]
    before = fresh[np.maximum(np.arange(count) - MOVING_ROWS, 0)]
    travel = samples.position[active][:, after] - samples.position[active][:, before]
    speed = np.abs(travel) / np.maximum(samples.time[after] - samples.time[before], samples.interval)
    moving = (speed > MOVING * np.sqrt(np.mean(speed**2, axis=1, keepdims=True))).any(axis=0)
    over: NDArray[np.bool_] = np.repeat(moving, np.diff(np.concatenate((fresh, [samples.count]))))
    return over


def _frozen(
    samples: Samples,
    active: NDArray[np.intp],
    fresh: NDArray[np.intp],
    start: NDArray[np.intp],
    length: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Tell which runs of equal rows are a stalled logger."""
    end = start + length
    last = samples.count - 1
    long: NDArray[np.bool_] = (
        (samples.time[np.minimum(end, last)] - samples.time[start] > FREEZE_SECONDS) & (start > 0) & (end <= last)
    )
    if not long.any():
        return long
    place = np.searchsorted(fresh, start)
    previous, following = fresh[np.maximum(place - 1, 0)], np.minimum(end, last)
    onward = fresh[np.minimum(place + 2, len(fresh) - 1)]
    position = samples.position[active]
    jump = np.abs(position[:, following] - position[:, start])
    beside = np.maximum(
        np.abs(position[:, start] - position[:, previous]), np.abs(position[:, onward] - position[:, following])
    )
    usual = np.sqrt(np.mean(np.diff(position[:, fresh], axis=1) ** 2, axis=1, keepdims=True))
    frozen: NDArray[np.bool_] = long & (jump > FREEZE_JUMP * np.maximum(beside, usual)).any(axis=0)
    return frozen


def _is_hold(samples: Samples, same: NDArray[np.bool_], judged: NDArray[np.bool_]) -> bool:
    share = float(np.mean(same[judged]))
    if share < HELD_SHARE:
        return False
    least = min(float(np.mean((signal[1:] == signal[:-1])[judged])) for signal in _channels(samples))
    return share > HELD_OF_REPEATS * least
