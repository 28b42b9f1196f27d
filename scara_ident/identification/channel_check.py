"""Are the channels what the mapping says? Opposite signs and exchanged joints imitate every effect, so they come first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.bands import HIGHEST_BAND
from scara_ident.estimation.least_squares import weighted_value, wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_gravity import urdf_gravity
from scara_ident.estimation.urdf_scale import urdf_scale
from scara_ident.identification.channel_fault import MENDED, ChannelFault, Signal, merged
from scara_ident.identification.magnitude_check import signed_fits
from scara_ident.model.terms.friction import Friction
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.prepared import PreparedData, PreparedStretch

# A better reading is better block by block at this level of significance.
LEVEL = 0.001
# Rows per parameter of each joint below which a fit comes near interpolation, whatever the channels are.
ENOUGH_ROWS = 3.0
# Share of the torque that another reading may leave at most in a band that was widened for rows: where noise has narrowed
# the chosen one, the rows of the wider are many and say as little.
EXPLAINED = 0.2
# Of readings that count the simpler is taken where the other leaves more than this share of what it leaves.
ALIKE = 0.8
# Pieces of each recording, one of which is held out in turns.
PIECES = 4
# Joints whose error is above this share of their torque may be exchanged with another.
POOR = 0.05
# A sign turned round leaves more than this of some joint's torque.
TURNED = 0.08
# A joint that is left more than this is looked at in a wider band too: what is read wrongly is explained in none.
NARROWED = 0.15
# Exchanging one signal alone makes nonsense of both joints; of the one whose torque is large beside the other's, at least.
BAD = 0.3
# Friction that feeds in this share of a joint's power, and this many standard deviations, points to a sign.
PUSHING = 0.02
PUSHING_STD = 4.0
# Residual that counts as none, as a share of the torque.
ROUNDING = 1e-12
# Hz up to which an arm that moves at all is moved.
MOVED = 5.0


def channel_faults(observations: Observations) -> tuple[ChannelFault, ...]:
    """Find efforts and positions of opposite sign, those of two joints that are exchanged, and efforts without a sign.

    A sign is suspected where friction would feed energy in or a joint is explained badly, an exchange where two joints are
    hardly explained; only then are other readings tried, in a band that no wrong reading has narrowed. One counts if it
    leaves at most half of the error, on blocks of time that it was not fitted to and significantly more often than not,
    and the friction brakes. Where rows are not several times as many as parameters none is tried: an interpolating fit is
    good or bad by chance. All efforts turned round leave as much as they do; see `_all_turned` and `_bodies_turned`.

    Parameters
    ----------
    observations : Observations
        The first run of every trajectory is used.

    Returns
    -------
    tuple of ChannelFault
        To be mended together; empty where nothing else fits better.
    """
    first = {label: place for place, label in reversed(list(enumerate(observations.data.labels)))}
    held = observations.of(sorted(first.values()))
    model = observations.model
    joints = model.robot.joints
    bands = _wide(held)
    errors = _relative(weighted_value(held.by_joint), held)
    narrow = _few(held)
    if narrow or any(errors[j] > NARROWED and bands[j] != held.data.bands[j] for j in range(len(joints))):
        # What is read wrongly is explained by no motion, so that its own band is left too narrow to tell.
        held = observe(model, held.data.at(bands))
    unsigned = _unsigned(held)
    if unsigned is not None:
        # What else is read into magnitudes is of no channel.
        return (unsigned,)
    few, most = _few(held), EXPLAINED if narrow else np.inf
    faults: list[ChannelFault] = []
    for _ in range(2 * len(joints)):
        fitted = weighted_value(held.by_joint)
        pushing = _pushing(fitted, held)
        found = None if few else _best_reading(held, _relative(fitted, held), pushing, most)
        if found is not None:
            faults.append(found[0])
            held = found[1]
            continue
        if np.any(pushing) and _all_turned(fitted, held, pushing):
            _, left = _held_out(held)
            faults.append(ChannelFault("effort", tuple(joints), False, _mean(left), _mean(left)))
        elif _bodies_turned(fitted, held, pushing):
            _, left = _held_out(held)
            faults.append(ChannelFault("effort", tuple(joints), False, _mean(left), _mean(left), by_bodies=True))
        break
    return merged(faults, joints)


def _wide(observations: Observations) -> tuple[float | None, ...]:
    """Return bands that any arm fills, as wide as the widest chosen, which is of a joint that is read rightly if any is."""
    data = observations.data
    widest = max((band for band in data.bands if band is not None), default=MOVED)
    wide = min(max(MOVED, widest), HIGHEST_BAND * min(part.rate for part in data.stretches))
    return tuple(None if band is None else max(band, wide) for band in data.bands)


def _best_reading(
    held: Observations, errors: Array, pushing: NDArray[np.bool_], most: float
) -> tuple[ChannelFault, Observations] | None:
    """Return the reading of the channels that leaves least, if one counts and leaves at most a share, and what is observed with it."""
    suspects = _suspects(errors, pushing)
    if not suspects:
        return None
    joints = held.model.robot.joints
    blocks, left = _held_out(held)
    best: tuple[ChannelFault, Observations] | None = None
    least = np.inf
    for signal, chosen, exchanged in suspects:
        read = _read_as(held.data, signal, chosen, exchanged)
        other = held.with_torque(read) if signal == "effort" else observe(held.model, read)
        then, mended = _held_out(other)
        said = np.ones(len(left), dtype=bool)
        if signal == "effort" and not exchanged:
            # All other joints may be explained for all that; those that are well explained either way say nothing.
            said = np.maximum(left, mended) > POOR
        before, after = _mean(left[said]), _mean(mended[said])
        if after >= min(MENDED * before, most) or _mean(mended) >= ALIKE * least or not _better(blocks, then):
            continue
        # A turned sign must take the push away, and add none; signs that an exchange brings to light are the next round's.
        allowed = np.count_nonzero(pushing) - (signal != "effort and position" and bool(pushing[chosen[0]]))
        if not exchanged and np.count_nonzero(_pushing(weighted_value(other.by_joint), other)) > allowed:
            continue
        names = tuple(joints[j] for j in chosen)
        best, least = (ChannelFault(signal, names, exchanged, before, after), other), _mean(mended)
    return best


def _few(observations: Observations) -> bool:
    return any(0 < rows.table.shape[1] < ENOUGH_ROWS * len(rows.columns) for rows in observations.joints)


def _unsigned(observations: Observations) -> ChannelFault | None:
    """Return the joints whose effort is explained far better as the magnitude of a torque of both signs."""
    if _few(observations):
        return None
    fits = {j: fit for j, fit in signed_fits(observations).items() if fit[1] < MENDED * fit[0]}
    if not fits:
        return None
    error, mended = np.exp(np.mean(np.log(np.maximum(list(fits.values()), ROUNDING)), axis=0)).tolist()
    names = tuple(observations.model.robot.joints[j] for j in fits)
    return ChannelFault("effort", names, False, error, mended, unsigned=True)


def _suspects(errors: Array, pushing: NDArray[np.bool_]) -> list[tuple[Signal, tuple[int, ...], bool]]:
    """Return readings worth trying: the signal, its joints, and whether they are exchanged or turned round."""
    one: tuple[Signal, ...] = ("effort", "position")
    both: Signal = "effort and position"
    poor = [int(j) for j in np.flatnonzero(errors > POOR)]
    found: list[tuple[Signal, tuple[int, ...], bool]] = []
    # An effort turned round may be taken up by parameters of its own joint, and show on those that carry it.
    found += [("effort", (int(j),), False) for j in np.flatnonzero(pushing | np.any(errors > TURNED))]
    found += [("position", (int(j),), False) for j in np.flatnonzero(pushing | (errors > TURNED))]
    if np.any(errors > TURNED) and not np.any(pushing):
        found += [(both, (j,), False) for j in range(len(errors))]
    for pair in combinations(poor, 2):
        found.append((both, pair, True))
        if np.any(errors[list(pair)] > BAD):
            found += [(signal, pair, True) for signal in one]
    return found


def _read_as(data: PreparedData, signal: Signal, joints: Sequence[int], exchanged: bool) -> PreparedData:
    """Return the recordings with a signal of one joint negated, or of two exchanged."""
    n = len(data.bands)
    order = list(range(n))
    sign = np.ones((n, 1))
    if exchanged:
        order[joints[0]], order[joints[1]] = joints[1], joints[0]
    else:
        sign[joints[0]] = -1.0

    def turned(rows: Array, wanted: bool) -> Array:
        return sign * rows[order] if wanted else rows

    def read(part: PreparedStretch) -> PreparedStretch:
        position = turned(part.stretch.position, "position" in signal)
        torque = turned(part.torque, "effort" in signal)
        if "position" not in signal:
            return part.with_torque_of(replace(part.stretch, torque=torque, _thinned={}))
        return PreparedStretch(
            replace(part.stretch, position=position, torque=torque, _filtered={}, _thinned={}), part.bands
        )

    recordings = [replace(item, stretches=tuple(map(read, item.stretches))) for item in data.recordings]
    return replace(data, recordings=tuple(recordings))


def _all_turned(value: Array, observations: Observations, pushing: NDArray[np.bool_]) -> bool:
    """Tell whether every effort has the opposite sign, which leaves as much as the right one and so is told by no residual.

    Friction pushes on some joint and brakes on none; and it pushes on all, with less energy fed in than none, or gravity and
    inertia are the opposite of the URDF's wherever these tell.
    """
    if np.all(pushing) and _net_power(observations.data) < 0.0:
        return True
    if np.any(_pushing(-value, observations)):
        return False
    scales = urdf_scale(wls(observations), observations).values()
    return bool(scales) and max(scales) < 0.0


def _bodies_turned(value: Array, observations: Observations, pushing: NDArray[np.bool_]) -> bool:
    """Tell whether gravity and inertia are surely those of the URDF the other way round, as no other direction of gravity has it.

    Friction, of which a sensor at the link sees little, may not speak against it on more joints than for it.
    """
    stated = urdf_values(observations.model)
    known = np.isfinite(stated)
    along = 0.0
    for rows in observations.joints:
        use = known[rows.columns]
        along += float(stated[rows.columns[use]] @ (rows.table[:-1][use] @ rows.table[-1]))
    # Nearly always this is all there is to compute.
    if along >= 0.0:
        return False
    gravity = urdf_gravity(observations)
    if gravity is None or not gravity.turned:
        return False
    return bool(np.count_nonzero(_pushing(-value, observations)) <= np.count_nonzero(pushing))


def _net_power(data: PreparedData) -> float:
    """Return the energy that the efforts feed into the arm over recordings, up to the reductions' scale."""
    return float(sum(np.sum(part.torque[:, 1:] * np.diff(part.stretch.position)) for part in data.stretches))


def _relative(value: Array, observations: Observations) -> Array:
    tiny = np.finfo(float).tiny
    return np.array([part.rms(value) / max(part.torque_rms, tiny) for part in observations.by_joint])


def _held_out(observations: Observations) -> tuple[Array, Array]:
    """Predict each piece of the recordings from the others.

    Returns
    -------
    left : ndarray, shape (blocks, n)
        Rms residual of each block as a share of the joint's torque; NaN where a joint has no rows.
    all_left : ndarray, shape (n,)
        The same over all blocks.
    """
    owner = observations.owner
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    piece = place * PIECES // np.bincount(owner)[owner]
    squares = np.zeros((len(owner), len(observations.joints)))
    for which in range(PIECES):
        fitted = np.flatnonzero(piece != which)
        parts = tuple(rows.part(fitted) for rows in observations.joints)
        value = weighted_value(replace(observations, joints=parts, owner=owner[fitted]).by_joint)
        for j, rows in enumerate(observations.joints):
            residual = rows.left(value)
            total = np.concatenate([[0.0], np.cumsum(residual**2)])
            squares[piece == which, j] = np.diff(total[rows.starts])[piece == which]
    counts = np.array([rows.counts for rows in observations.joints]).T
    torque = np.array([max(part.torque_rms, np.finfo(float).tiny) for part in observations.by_joint])
    with np.errstate(invalid="ignore", divide="ignore"):
        left = np.sqrt(np.maximum(squares, 0.0) / counts) / torque
        relative = np.sqrt(np.sum(squares, axis=0) / np.sum(counts, axis=0)) / torque
    return left, relative


def _mean(left: Array) -> float:
    """Return the geometric mean over the joints that have rows."""
    known = left[np.isfinite(left)]
    return float(np.exp(np.mean(np.log(np.maximum(known, ROUNDING))))) if len(known) else 1.0


def _better(left: Array, other: Array) -> bool:
    """Whether other residuals are smaller block by block, by a t test of the logarithms of their ratios."""
    from scipy.special import stdtrit

    both = np.isfinite(left) & np.isfinite(other)
    ratios = np.where(both, np.log(np.maximum(other, ROUNDING)) - np.log(np.maximum(left, ROUNDING)), 0.0)
    shared = np.sum(both, axis=1)
    mean = np.sum(ratios, axis=1)[shared > 0] / shared[shared > 0]
    if len(mean) < 2:
        return False
    spread = float(np.std(mean, ddof=1)) / np.sqrt(len(mean))
    return bool(np.mean(mean) + float(stdtrit(len(mean) - 1, 1.0 - LEVEL)) * spread < 0.0)


def _pushing(value: Array, observations: Observations) -> NDArray[np.bool_]:
    """Return the joints whose estimated friction feeds energy in over the recorded motion, beyond its uncertainty."""
    robot = observations.model.robot
    friction = np.zeros(observations.parameters, dtype=bool)
    for term in observations.model.terms:
        if isinstance(term, Friction):
            friction[observations.model.place(term)] = True
    powers = np.zeros((robot.n, observations.parameters))
    for j, rows in enumerate(observations.joints):
        own = np.flatnonzero(friction[rows.columns])
        passed = 0.0
        for item, raws in zip(observations.data.recordings, observations.raw, strict=True):
            part, raw = max(zip(item.stretches, raws, strict=True), key=lambda pair: pair[0].samples)
            drive = robot.drive_sign[j] * part.motion.v[j]
            powers[j, rows.columns[own]] += raw[j][own] @ drive
            passed += float(np.sum(np.abs(part.torque[j] * drive)))
        if powers[j] @ value >= -PUSHING * passed:
            powers[j] = 0.0
    if not np.any(powers):
        return np.zeros(robot.n, dtype=bool)
    # How sure the power is takes more time than the power, and mostly no joint is suspected.
    covariance = wls(observations).covariance
    known = np.isfinite(np.diag(covariance))
    spread = np.where(known[:, None] & known, covariance, 0.0)
    std = np.sqrt(np.einsum("jp,pq,jq->j", powers, spread, powers))
    std[np.any(powers[:, ~known], axis=1)] = np.inf
    return np.asarray((powers @ value < -PUSHING_STD * std) & np.any(powers, axis=1))
