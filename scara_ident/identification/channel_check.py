"""Are the channels what the mapping says? Opposite signs, other zeros and exchanged joints imitate every effect, so they come first."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.bands import HIGHEST_BAND
from scara_ident.estimation.least_squares import weighted_value, wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_gravity import urdf_gravity
from scara_ident.estimation.urdf_scale import urdf_scale
from scara_ident.identification.channel_comparison import (
    POOR,
    ROUNDING,
    SIMPLER_SHARE,
    far_less,
    few,
    first_runs,
    friction_pushes,
    held_out,
    mean,
    relative,
)
from scara_ident.identification.channel_fault import ChannelFault, merged
from scara_ident.identification.channel_reading import Signal, as_mapped, observed_as, observed_exchanged, turned
from scara_ident.identification.few_rows import FewRows, few_rows
from scara_ident.identification.magnitude_check import unsigned_efforts
from scara_ident.identification.zero_check import wrong_zeros
from scara_ident.model.urdf_values import urdf_values
from scara_ident.motion.prepared import PreparedData
from scara_ident.threads import one_blas_thread

# Share of the torque that another reading may leave at most in a band that was widened for rows: where noise has narrowed
# the chosen one, the rows of the wider are many and say as little.
EXPLAINED = 0.2
# A sign turned round leaves more than this of some joint's torque.
TURNED = 0.08
# A joint that is left more than this is looked at in a wider band too: what is read wrongly is explained in none.
NARROWED = 0.15
# Share of what the mapping leaves of few rows that another reading leaves at most, to be looked at on all: half counts there.
FEW_LESS = 0.9
# Exchanging one signal alone makes nonsense of both joints; of the one whose torque is large beside the other's, at least.
BAD = 0.3
# Hz up to which an arm that moves at all is moved.
MOVED = 5.0
# A signal, its joints, and whether they are exchanged or turned round.
Suspect = tuple[Signal, tuple[int, ...], bool]


def channel_faults(observations: Observations) -> tuple[ChannelFault, ...]:
    """Find efforts and positions of opposite sign or of two joints exchanged, other zeros, and efforts without a sign.

    A sign, or a zero by quarter turns (see `wrong_zeros`), is suspected where friction would feed energy in or a joint is
    explained badly, an exchange where two joints are hardly explained; only then are other readings tried, in a band that
    no wrong reading has narrowed. One counts if it leaves at most half of the error, of all joints or of those that are
    hardly explained, on blocks of time that it was not fitted to and significantly more often than not, and the friction brakes. Where rows are not several times as many as
    parameters none is tried: an interpolating fit is good or bad by chance. All efforts turned round leave as much as they
    do; see `_all_turned` and `_bodies_turned`.

    Parameters
    ----------
    observations : Observations
        The first run of every trajectory is used.

    Returns
    -------
    tuple of ChannelFault
        To be mended together; empty where nothing else fits better.
    """
    # Hundreds of small fits: on products of such columns two threads of BLAS take ten times as long as one.
    with one_blas_thread():
        return _faults(first_runs(observations))


def _faults(held: Observations) -> tuple[ChannelFault, ...]:
    model = held.model
    joints = model.robot.joints
    bands = wide_bands(held)
    errors = relative(weighted_value(held.by_joint), held)
    narrow = few(held)
    if narrow or any(errors[j] > NARROWED and bands[j] != held.data.bands[j] for j in range(len(joints))):
        # What is read wrongly is explained by no motion, so that its own band is left too narrow to tell.
        held = observe(model, held.data.at(bands))
    unsigned = _unsigned(held)
    if unsigned is not None:
        # What else is read into magnitudes is of no channel.
        return (unsigned,)
    too_few, most = few(held), EXPLAINED if narrow else np.inf
    faults: list[ChannelFault] = []
    for _ in range(2 * len(joints)):
        fitted = weighted_value(held.by_joint)
        pushing = friction_pushes(fitted, held)
        found = None if too_few else _best_reading(held, relative(fitted, held), pushing, most)
        if found is not None:
            faults += found[0]
            held = found[1]
            continue
        if np.any(pushing) and _all_turned(fitted, held, pushing):
            _, left = held_out(held)
            faults.append(ChannelFault("effort", tuple(joints), False, mean(left), mean(left)))
        elif _bodies_turned(fitted, held, pushing):
            _, left = held_out(held)
            faults.append(ChannelFault("effort", tuple(joints), False, mean(left), mean(left), by_bodies=True))
        break
    return merged(faults, joints)


def wide_bands(observations: Observations) -> tuple[float | None, ...]:
    """Return bands that any arm fills, as wide as the widest chosen, which is of a joint that is read rightly if any is."""
    data = observations.data
    widest = max((band for band in data.bands if band is not None), default=MOVED)
    wide = min(max(MOVED, widest), HIGHEST_BAND * min(part.rate for part in data.stretches))
    return tuple(None if band is None else max(band, wide) for band in data.bands)


def _best_reading(
    held: Observations, errors: Array, pushing: NDArray[np.bool_], most: float
) -> tuple[list[ChannelFault], Observations] | None:
    """Return the reading of the channels that leaves least, if one counts and leaves at most a share, and what is observed with it."""
    suspects = _suspects(errors, pushing)
    if not suspects:
        return None
    joints = held.model.robot.joints
    before, rows = held_out(held), few_rows(held)
    # What is read wrongly may have narrowed one joint's band so far that little is seen in it of the others.
    each = (rows,) if len(set(held.data.bands)) == 1 else (rows, few_rows(held, widest=True))
    best: tuple[list[ChannelFault], Observations] | None = None
    least = np.inf
    zeros = wrong_zeros(held, rows, before, pushing, most) if np.any(errors > TURNED) else None
    if zeros is not None:
        best, least = (zeros.faults(joints), zeros.observations), zeros.left
    for signal, chosen, exchanged in suspects:
        suspect = (signal, chosen, exchanged)
        if zeros is not None and mean(_few_left(rows, suspect)) >= zeros.few_left:
            continue
        if not any(_less_of_few(one, suspect) for one in each):
            continue
        if exchanged:
            other = observed_exchanged(held, signal, (chosen[0], chosen[1]))
        else:
            other = observed_as(held, turned(len(joints), signal, chosen[0]))
        then = held_out(other)
        if mean(then[1]) >= SIMPLER_SHARE * least:
            continue
        # All other joints may be explained for all that.
        said = far_less(before, then, most, poor=signal == "effort" and not exchanged)
        if said is None:
            continue
        # A turned sign must take the push away, and add none; signs that an exchange brings to light are the next round's.
        allowed = np.count_nonzero(pushing) - (signal != "effort and position" and bool(pushing[chosen[0]]))
        if not exchanged and np.count_nonzero(friction_pushes(weighted_value(other.by_joint), other)) > allowed:
            continue
        names = tuple(joints[j] for j in chosen)
        best, least = ([ChannelFault(signal, names, exchanged, *said)], other), mean(then[1])
    return best


def _less_of_few(rows: FewRows, suspect: Suspect) -> bool:
    """Tell whether a reading leaves less of few rows than the mapping: most do not, which takes a hundredth of the time there.

    So may one that few rows say nothing of, as both explain them: then all rows tell.
    """
    signal, _, exchanged = suspect
    before, after = rows.left(as_mapped(len(rows.q))), _few_left(rows, suspect)
    said = np.ones(len(before), dtype=bool) if exchanged or signal != "effort" else np.maximum(before, after) > POOR
    return not np.any(said) or mean(after[said]) < FEW_LESS * mean(before[said])


def _few_left(rows: FewRows, suspect: Suspect) -> Array:
    """Return what a reading leaves of each joint on few rows, shape (n,)."""
    signal, joints, exchanged = suspect
    mapped = as_mapped(len(rows.q))
    if exchanged:
        return rows.exchanged(signal, (joints[0], joints[1])).left(mapped)
    return rows.left(turned(len(mapped), signal, joints[0]))


def _unsigned(observations: Observations) -> ChannelFault | None:
    """Return the joints whose effort is predicted far better as the magnitude of a torque of both signs."""
    if few(observations):
        return None
    fits = unsigned_efforts(observations)
    if not fits:
        return None
    error, mended = np.exp(np.mean(np.log(np.maximum(list(fits.values()), ROUNDING)), axis=0)).tolist()
    names = tuple(observations.model.robot.joints[j] for j in fits)
    return ChannelFault("effort", names, False, error, mended, unsigned=True)


def _suspects(errors: Array, pushing: NDArray[np.bool_]) -> list[Suspect]:
    """Return readings worth trying: the signal, its joints, and whether they are exchanged or turned round."""
    one: tuple[Signal, ...] = ("effort", "position")
    both: Signal = "effort and position"
    poor = [int(j) for j in np.flatnonzero(errors > POOR)]
    found: list[Suspect] = []
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


def _all_turned(value: Array, observations: Observations, pushing: NDArray[np.bool_]) -> bool:
    """Tell whether every effort has the opposite sign, which leaves as much as the right one and so shows in no residual.

    Friction pushes on some joint and brakes on none; and it pushes on all, with less energy fed in than none, or gravity and
    inertia are the opposite of the URDF's wherever these tell.
    """
    if np.all(pushing) and _net_power(observations.data) < 0.0:
        return True
    if np.any(friction_pushes(-value, observations)):
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
    return bool(np.count_nonzero(friction_pushes(-value, observations)) <= np.count_nonzero(pushing))


def _net_power(data: PreparedData) -> float:
    """Return the energy that the efforts feed into the arm over recordings, up to the reductions' scale."""
    return float(sum(np.sum(part.torque[:, 1:] * np.diff(part.stretch.position)) for part in data.stretches))
