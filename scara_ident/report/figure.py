"""A picture of measured, predicted and residual torque."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.identification.identify import Identification
from scara_ident.motion.motion import low_pass, stretches
from scara_ident.motion.prepared import raw_rows
from scara_ident.recording.recording import Recording

Array = NDArray[np.float64]

# Recordings shown, at the most; the first held-out ones before the fitted ones.
MOST_RECORDINGS = 4
# Bins of time of which the extremes are drawn: a column is narrower than that many pixels.
MOST_BINS = 600


def torque_figure(path: Path, identification: Identification, recordings: Sequence[Recording]) -> None:
    """Draw measured, predicted and residual torque over time, a column per recording and a row per joint.

    Parameters
    ----------
    path : Path
        PNG file.
    identification : Identification
    recordings : sequence of Recording
        Those that were fitted or held out.
    """
    from matplotlib.figure import Figure

    robot = identification.model.robot
    held_out = {item.recording for item in identification.validation}
    shown = sorted(recordings, key=lambda recording: recording.name not in held_out)[:MOST_RECORDINGS]
    width, height = 4.5 * len(shown) + 1.0, 2.3 * robot.n + 0.8
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(robot.n, len(shown), squeeze=False)
    # In inches, so that nothing has to be measured first.
    figure.subplots_adjust(0.85 / width, 0.85 / height, 1.0 - 0.15 / width, 1.0 - 0.35 / height, 0.17, 0.25)
    for column, recording in enumerate(shown):
        for part in stretches(recording):
            _, raw = raw_rows(identification.model, part, identification.bands)
            for j in range(robot.n):
                predicted = identification.estimate.value @ raw[j][:-1]
                both = low_pass(np.stack([raw[j][-1], predicted]), part.rate, identification.bands[j])
                measured, predicted = both
                axis = axes[j, column]
                axis.plot(*_extremes(part.time, raw[j][-1]), color="0.8", lw=0.6, label="recorded")
                for signal, label, color, style in (
                    (measured, "measured, in the band", "#0072b2", "-"),
                    (predicted, "predicted", "#d55e00", "--"),
                    (measured - predicted, "residual", "#009e73", "-"),
                ):
                    axis.plot(*_extremes(part.time, signal), color=color, lw=0.9, ls=style, label=label)
                axis.axhline(0.0, color="0.5", lw=0.4)
                limit = 1.3 * float(np.max(np.abs(measured), initial=1e-12))
                axis.set_ylim(-limit, limit)
        kind = "held out" if recording.name in held_out else "fitted"
        axes[0, column].set_title(f"{recording.name} ({kind})", fontsize=9)
        axes[-1, column].set_xlabel("time [s]")
    for j, joint in enumerate(robot.joints):
        axes[j, 0].set_ylabel(f"{joint}\n[{robot.torque_unit(j)}]", fontsize=8)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="lower center", ncols=4, fontsize=8, frameon=False)
    figure.savefig(path, dpi=110)


def _extremes(time: Array, signal: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest value of every bin, so that a long recording draws fast and keeps its peaks."""
    size = len(signal) // MOST_BINS
    if size < 4:
        return time, signal
    count = len(signal) // size
    bins = signal[: count * size].reshape(count, size)
    places = np.sort(np.stack([bins.argmin(axis=1), bins.argmax(axis=1)]), axis=0) + size * np.arange(count)
    kept = np.append(places.T.ravel(), np.arange(count * size, len(signal)))
    return time[kept], signal[kept]
