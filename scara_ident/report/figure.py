"""A picture of measured, predicted and residual torque."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scara_ident.identification import Identification
from scara_ident.motion import low_pass, stretches
from scara_ident.recording import Recording
from scara_ident.rows import rows_of

# Recordings shown, at the most; the first held-out ones before the fitted ones.
MOST_RECORDINGS = 4


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
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    robot = identification.model.robot
    held_out = {item.recording for item in identification.validation}
    shown = sorted(recordings, key=lambda recording: recording.name not in held_out)[:MOST_RECORDINGS]
    figure, axes = pyplot.subplots(
        robot.n, len(shown), figsize=(4.5 * len(shown) + 1.0, 2.3 * robot.n + 0.8), squeeze=False, layout="constrained"
    )
    for column, recording in enumerate(shown):
        for part in stretches(recording):
            rows = rows_of(identification.model, part, identification.bands)
            for j in range(robot.n):
                predicted = identification.estimate.value @ rows.raw[j][:-1]
                both = low_pass(np.stack([rows.raw[j][-1], predicted]), part.rate, identification.bands[j])
                measured, predicted = both
                axis = axes[j, column]
                axis.plot(
                    part.time,
                    part.torque[j] if part.torque is not None else measured,
                    color="0.8",
                    lw=0.6,
                    label="recorded",
                )
                axis.plot(part.time, measured, color="#0072b2", lw=1.0, label="measured, in the band")
                axis.plot(part.time, predicted, color="#d55e00", lw=1.0, ls="--", label="predicted")
                axis.plot(part.time, measured - predicted, color="#009e73", lw=0.8, label="residual")
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
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
