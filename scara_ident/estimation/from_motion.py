"""From motion and torque as arrays to the information on a model, in memory that does not grow with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.errors import RecordingError
from scara_ident.estimation.information import Information, merge
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.threads import THREADS, side_by_side

# Samples at a time: enough to hide the cost of a call, and with all their columns so many numbers that the cache holds them.
MIN_CHUNK, MAX_CHUNK, NUMBERS = 4096, 16384, 300_000


def chunk_of(model: TorqueModel) -> int:
    """Return how many samples of a model are made and absorbed at a time."""
    columns = sum(len(own) + 1 for own in model.active)
    return min(MAX_CHUNK, max(MIN_CHUNK, NUMBERS // columns))


def information_of(model: TorqueModel, motion: Motion) -> tuple[Information, ...]:
    """Return the rows of each joint as triangular factors; nothing is filtered, left out or thinned.

    Columns are made for some thousand samples, absorbed and forgotten.

    Parameters
    ----------
    model : TorqueModel
        Of n joints and p parameters.
    motion : Motion
        With torque.

    Returns
    -------
    tuple of Information
        One for each joint, of all p parameters; see `scara_ident.estimation.information.merge` and `joint_noise`.

    Raises
    ------
    RecordingError
        If there is no torque, or a number of the motion is none.

    Examples
    --------
    >>> import numpy as np
    >>> from scara_ident import Motion, build_model, load_robot
    >>> from scara_ident.estimation.information import merge
    >>> model = build_model(load_robot(), "basic")
    >>> time = np.arange(20_000) / 1000.0
    >>> speed = np.array([[2.0], [3.0]])
    >>> q, v, a = np.sin(speed * time), speed * np.cos(speed * time), -(speed**2) * np.sin(speed * time)
    >>> motion = Motion("sines", "sines", time, q, v, a, torque=0.3 * np.sign(v), rate=1000.0)
    >>> value = merge(information_of(model, motion)).solve().value
    >>> {name: round(float(x), 6) for name, x in zip(model.names, value) if abs(x) > 1e-9}
    {'a01': 0.3, 'a02': 0.3}
    """
    torque = motion.torque
    if torque is None:
        raise RecordingError(f"{motion.name}: no effort was recorded; it is needed to identify")

    chunk = min(chunk_of(model), max(1, motion.samples))

    def of_some(starts: Sequence[int]) -> list[Information]:
        memory = [np.empty((len(own) + 1, chunk)) for own in model.active]
        found = [Information.empty(len(own)) for own in model.active]
        for start in starts:
            part = motion.part(start, start + chunk)
            rows = [own[:, : part.samples] for own in memory]
            model.joint_columns(part, [own[:-1] for own in rows])
            for joint, own in enumerate(rows):
                own[-1] = torque[joint, start : start + chunk]
                found[joint] = found[joint].absorb_columns(own)
        return found

    starts = range(0, motion.samples, chunk)
    each = side_by_side(of_some, [starts[k::THREADS] for k in range(THREADS)])
    whole = [merge(parts) for parts in zip(*each, strict=True)]
    for joint, found in zip(model.robot.joints, whole, strict=True):
        if not np.isfinite(found.factor).all():
            raise RecordingError(
                f"{motion.name}: NaN or infinite numbers in the equation of {joint}; leave those samples out"
            )
    return tuple(found.embed(own, len(model.columns)) for own, found in zip(model.active, whole, strict=True))
