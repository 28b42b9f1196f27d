"""Faults of the log itself: missing numbers, the clock."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import GAP_STEPS, Checked, Finding, Samples, runs

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
MAX_INTERVAL, MIN_INTERVAL = 0.2, 1e-5
CLOCKS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
# A robot is usually logged near 500 Hz; of two readings of a clock, the one nearer to this is meant.
USUAL_INTERVAL = 2e-3
# Beyond this share of steps back rows are in no order, and their steps tell no unit.
BACK_SHARE = 0.1
# Beyond this share the clock is too coarse, and what is kept would depend on which row came first.
REPEATED_SHARE = 0.05
# On a clock whose steps up to LATE_STEPS vary by less than STEADY_SHARE, a step within WHOLE_STEP_TOLERANCE (three times that variation, if it is
# more) of two or more whole steps is a sample lost; any other long step is a sample late.
LATE_STEPS, STEADY_SHARE, WHOLE_STEP_TOLERANCE = 1.5, 0.1, 0.1
# Below this, taking the interval as constant misplaces a position by less than a thirtieth of what it travels a sample.
JITTER = 0.03
# Stamps of an uneven clock that are rounded to this share of the interval misplace the positions by more than most encoders.
COARSE = 0.02
# Finer than a microsecond, stamps that count from 1970 hold rounding alone.
FINEST = 1e-6


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
        samples.refuse(f"{what}: too many to leave out; record that channel, or cut the file to the part that has it")
    if longest > MISSING_RUN:
        samples.refuse(f"{what}, up to {longest} rows in a row; cut the file there, or fill in that channel")
    said = f"{what}: {several(total, 'row')} left out"
    return samples.kept(~bad), [Finding("nan", said, total)]


def clock_unit(samples: Samples) -> Checked:
    """Refuse a time that stands still or does not count seconds."""
    step = np.diff(samples.time)
    if np.mean(step < 0) > BACK_SHARE:
        # Said by `time_order`.
        return samples, []
    step = step[step > 0]
    if not len(step):
        samples.refuse("time never advances; it must be in seconds and grow from row to row")
    median = float(np.median(step))
    if MIN_INTERVAL <= median <= MAX_INTERVAL:
        return samples, []
    fitting = [(n, f) for n, f in CLOCKS if MIN_INTERVAL <= median / f <= MAX_INTERVAL]
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
            f"time runs backwards at row {samples.row[here]}, from {samples.clock(before)} to "
            f"{samples.clock(here)} ({several(len(back), 'time')} in all); "
            "sort the rows by time, or cut the file there"
        )
    repeated = step == 0
    differing = repeated & ~samples.repeats()
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
        f"time does not advance in {several(total, 'row')} ({values}), first in {samples.where(first)}: the first row "
        f"of each time is kept"
    )
    return samples.kept(np.concatenate(([True], ~repeated))), [Finding("repeated_time", said, total)]


def sampling(samples: Samples) -> Checked:
    """Say how even the clock is, where samples are lost and where the recording has gaps."""
    step = np.diff(samples.time)
    median = float(np.median(step))
    # A step over rows that were left out is none of the clock's; where those were copies, no time went by in them.
    left_out = np.minimum(median * (np.diff(samples.row) - 1), step - median)
    step = np.where(step > LATE_STEPS * median, step - left_out, step)
    gap = step > GAP_STEPS * median
    late = step > LATE_STEPS * median
    unsteady = float(np.std(step[~late])) / median
    near = np.abs(step / median - np.rint(step / median)) < max(WHOLE_STEP_TOLERANCE, 3 * unsteady)
    lost = late & ~gap & near & (unsteady < STEADY_SHARE)
    usual = step[~(gap | lost)]
    jitter = float(np.std(usual)) / median
    found = []
    if jitter > JITTER:
        said = (
            f"sampling interval varies by {100 * jitter:.2g} % (std), {1e3 * usual.min():.3g} to "
            f"{1e3 * usual.max():.3g} ms about {1e3 * median:.3g} ms: the time stamps are used"
        )
        rounded = FINEST * float(np.gcd.reduce(np.rint(np.diff(samples.time) / FINEST).astype(np.int64)))
        if rounded > COARSE * median:
            said += (
                f"; they are rounded to {1e3 * rounded:.3g} ms, which is noise of the positions in motion: record time with "
                "more digits"
            )
        found.append(Finding("jitter", said))
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


def _not_finite(samples: Samples) -> NDArray[np.bool_] | None:
    """Tell which samples lack a number, shape (N,); None where all have theirs, which the extremes tell at once."""
    signals = [samples.time, *samples.channels()]
    if all(signal.min() > -HUGE and signal.max() < HUGE for signal in signals):
        return None
    bad = np.zeros(samples.count, dtype=bool)
    for signal in signals:
        bad |= ~_finite(signal)
    return bad


def _finite(signal: Array) -> NDArray[np.bool_]:
    finite: NDArray[np.bool_] = np.abs(signal) < HUGE
    return finite
