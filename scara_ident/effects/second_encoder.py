"""The stiffness of a gear by an encoder behind it, without a fit.

The motor's own row of the equations of motion has nothing of the links in it (Spong 1987): with the lag x of the link,
motor less link,

    recorded torque = J a + friction(v) + k x + d x' + constant

for the rotor's J, and each run's own constant, as encoders have zeros of their own. All columns are measured, so that
stiffness k and damping d follow by least squares, without masses and inertias of links or a resonance. Where a stiff gear
passes on little but the inertia of its link, lag and acceleration are alike: there J is as the description states it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.parameters import Parameter
from scara_ident.effects.signals import Scene
from scara_ident.motion.low_pass import differentiate
from scara_ident.motion.prepared import PreparedRecording, PreparedStretch

# Share of a stretch's samples that the second encoder must have.
MIN_KNOWN_SHARE = 0.99
# A stiffness is significant from this many standard deviations, where noise is at most this share of the lag's square, and the torque
# that the gear passes on explains this share of it, which that of a clearance does not.
MIN_STDS, MAX_NOISE, MIN_EXPLAINED = 5.0, 0.02, 0.8


def gear_stiffness(
    scene: Scene, recordings: Sequence[PreparedRecording], joint: int, rotor_std: float
) -> Parameter | None:
    """Return the stiffness of a joint's gear, at the joint, by its second encoder.

    Parameters
    ----------
    scene : Scene
        Its base model says which friction the joint has; its parameters do not matter.
    recordings : sequence of PreparedRecording
        Those whose second encoder lacks samples do not count.
    joint : int
        Its place.
    rotor_std : float
        Of the rotor's inertia where the description states it, as a share.

    Returns
    -------
    Parameter or None
        The standard deviation by blocks of time, and by what of the lag no torque made, which makes a gear look stiffer or
        softer: of what is left all that is not white. None where no lag is seen.
    """
    columns, torque, blocks, noise = [], [], [], 0.0
    runs = [item for item in recordings if item.recording.link_position is not None]
    count = 0
    for place, item in enumerate(runs):
        for part in item.stretches:
            lag = _lag(item, part, joint)
            if lag is None or not part.usable:
                continue
            own, level = _columns(scene, part, joint, lag)
            constants = np.zeros((len(runs), part.samples))
            constants[place] = 1.0
            rows = part.rows(joint, np.concatenate([own, constants, part.torque[joint : joint + 1]]))
            columns.append(rows[:-1])
            torque.append(rows[-1])
            starts = part.block_starts(joint)
            blocks.append(count + np.repeat(np.arange(len(starts) - 1), np.diff(starts)))
            count += len(starts) - 1
            noise = max(noise, level)
    if not columns:
        return None
    table, right, owner = np.concatenate(columns, axis=1), np.concatenate(torque), np.concatenate(blocks)
    seen = np.any(table != 0.0, axis=1)
    if table.shape[1] < 2 * np.count_nonzero(seen) or count <= np.count_nonzero(seen):
        return None
    # The lag is the first column, the acceleration the third.
    scale = np.sqrt(np.mean(table[seen] ** 2, axis=1))
    table = np.concatenate([(table[seen] / scale[:, None]).T, np.zeros((1, len(scale)))])
    value = np.linalg.lstsq(table, np.append(right, 0.0), rcond=None)[0]
    rms = float(np.sqrt(np.mean((right - table[:-1] @ value) ** 2)))
    armature = scene.nominal_armature(joint)
    if scene.robot.rotor_stated[joint] and armature > 0.0:
        # Known to so much as one more row.
        table[-1, 2] = rms / (rotor_std * armature) / scale[2]
    inverse = np.linalg.pinv(table)
    value = inverse @ np.append(right, armature * table[-1, 2] * scale[2])
    by_block = np.zeros(count)
    np.add.at(by_block, owner, inverse[0, :-1] * (right - table[:-1] @ value))
    squares = float(np.sum(by_block**2)) * count / (count - len(scale)) + (inverse[0, -1] * rms) ** 2
    # What of the lag the other columns do not span, per row, has this share of noise.
    alone = 1.0 / (float(np.sum(inverse[0] ** 2)) * len(right))
    share = noise**2 / (alone * scale[0] ** 2)
    stiffness = float(value[0] / scale[0])
    # Of what the other columns do not span: zeros and speed are most of any lag.
    both = np.stack([table[:-1, 0], right])
    beside = table[:-1, 1:]
    own_lag, passed = both - np.linalg.lstsq(beside, both.T, rcond=None)[0].T @ beside.T
    made = value[0] * own_lag
    left = passed - made
    # What is left and is not white, as the noise of a torque is, may be the lag's.
    near = owner[1:] == owner[:-1]
    white = 0.5 * float(np.mean((left[1:] - left[:-1])[near] ** 2)) if np.any(near) else 0.0
    slow = max(0.0, float(np.mean(left**2)) - white)
    alike = float(np.mean(made**2)) / (float(np.mean(made**2)) + slow)
    # What of the lag no torque made, be it noise or an encoder's error that repeats, makes a gear look softer by no more than
    # the torque leaves of the lag: regressed the other way round, on the torque, the stiffness is so much larger.
    softer = max(share, 1.0 / max(alike, MIN_EXPLAINED) - 1.0)
    std = float(np.hypot(np.sqrt(squares) / scale[0], softer * stiffness))
    if share > MAX_NOISE or not alike > MIN_EXPLAINED or not stiffness > MIN_STDS * std:
        return None
    return Parameter(stiffness, std, "N/m" if scene.robot.prismatic[joint] else "N m/rad")


def _lag(item: PreparedRecording, part: PreparedStretch, joint: int) -> Array | None:
    """Return motor less link on the uniform grid, not filtered, shape (N,); None where too little of it was recorded."""
    record, inside = item.recording, part.stretch.source
    assert record.link_position is not None
    time, link = record.time[inside], record.link_position[joint][inside]
    known = np.isfinite(link)
    if np.count_nonzero(known) < MIN_KNOWN_SHARE * len(known):
        return None
    lag = record.position[joint][inside][known] - link[known]
    return np.asarray(np.interp(part.stretch.time, time[known], lag))


def _columns(scene: Scene, part: PreparedStretch, joint: int, lag: Array) -> tuple[Array, float]:
    """Return the lag, its derivative, the acceleration and the friction's columns, (k, N), and the lag's noise in the band."""
    model, motion = scene.model, part.motion
    cut = part.cuts[joint]
    smooth, first, _ = differentiate(lag, part.rate, cut)
    place = model.place(model.rigid_body)
    own = model.active[joint]
    friction = model.joint_columns(motion)[joint][(own < place.start) | (own >= place.stop)]
    band, half, scale = part.bands[joint], 0.5 * part.rate, scene.robot.row_scale[joint]
    noise = 0.0
    if cut is not None and band is not None and cut < half:
        noise = float(abs(scale) * np.sqrt(np.mean((lag - smooth)[part.used[joint]] ** 2) * band / (half - cut)))
    return np.concatenate([scale * np.array([smooth, first, motion.a[joint]]), friction]), noise
