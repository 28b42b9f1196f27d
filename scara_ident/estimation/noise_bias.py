"""The bias of estimated parameters by position noise.

Velocities and accelerations stand in the regressor with their noise, which makes least squares err to one side however
much is recorded. With the noise twice the estimate moves by as much again (Cook and Stefanski 1994); that this is more
than chance is what Durbin, Wu and Hausman test. The estimate is left as it is, and the bias stands in its covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from weakref import WeakKeyDictionary

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import Information, merge, weighted
from scara_ident.estimation.observations import Observations, informations
from scara_ident.estimation.sample_columns import few_enough
from scara_ident.manners import listed
from scara_ident.motion.low_pass import derivative
from scara_ident.motion.position_noise import NoiseSizes, forget_stepless, noise_sizes, noisier
from scara_ident.motion.prepared import PreparedData, PreparedRecording
from scara_ident.threads import side_by_side

# Share of an acceleration's square that is noise within the band: less biases an inertia by less than a hundredth of a percent.
NEGLIGIBLE = 1e-4
# What lags by the torque behind a gear has two derivatives more than the torque, and noise above slow motion accordingly.
OF_LAG = 2
# Standard deviations by which the noise moves a parameter before that is said.
SPOKEN_OF = 1.0

# Of observations the last parameters that the noise in the torque was asked for, and what was found.
_LAST: WeakKeyDictionary[Observations, tuple[Array, Array, Array]] = WeakKeyDictionary()


def noise_bias(observations: Observations, weights: Array, value: Array | None) -> Array | None:
    """Return by how much the noise of positions moves parameters, shape (p,); None where it is negligible.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Of each joint's rows.
    value : ndarray, shape (p,), or None
        Least squares with them, where it is known.
    """
    if not noisy(observations.data):
        return None
    here = observations.in_memory
    # The bias follows from the motion: a repetition has the same, and adds to what is known of it chance alone.
    places = [here.data.labels.index(label) for label in dict.fromkeys(here.data.labels)]
    again = _drawn_again(here, places)
    # What is compared is of the same samples.
    same = here is observations and len(places) == len(here.data.recordings)
    once = value if same and value is not None else weighted(here.of(places).by_joint, weights).solve().value
    return np.asarray(weighted(again, weights).solve().value - once)


def _drawn_again(observations: Observations, places: Sequence[int]) -> tuple[Information, ...]:
    """Return the rows of every joint of some recordings with the noise once more, of more than are held group by group."""
    model, data = observations.model, observations.data
    if few_enough(data):
        return informations(model, noisier(data).of(places))
    groups: list[list[int]] = []
    for place in places:
        if groups and few_enough(data.of([*groups[-1], place])):
            groups[-1].append(place)
        else:
            groups.append([place])
    drawn = []
    for seed, group in enumerate(groups):
        some = data.of(group)
        drawn.append(informations(model, noisier(some, seed)))
        forget_stepless(some)
    return tuple(merge(parts) for parts in zip(*drawn, strict=True))


def noise_torque(observations: Observations, value: Array) -> Array:
    """Return the rms that the noise of positions makes in the torque that parameters predict, within the bands, shape (n,).

    Parameters
    ----------
    value : ndarray, shape (p,)
    """
    squares, counts = _noise_in_blocks(observations, value)
    return np.asarray(np.sqrt(squares.sum(axis=1) / np.maximum(counts.sum(axis=1), 1.0)))


def largest_noise_torque(observations: Observations, value: Array, chance: float) -> Array:
    """Return the rms that another draw of the noise makes, beyond which it is by chance alone this seldom, shape (n,).

    An encoder's steps come again where a motion does to less than a step, the same in each repetition: what repeats is then one draw of
    the noise on as many motions as there are, beside another draw on all recordings. Mean squares of either have the degrees of
    freedom that blocks of time show, and their ratio is Fisher's F.

    Parameters
    ----------
    value : ndarray, shape (p,)
    chance : float
    """
    from scipy.special import fdtri

    data = observations.data
    usual, (squares, counts) = noise_torque(observations, value), _noise_in_blocks(observations, value)
    once = np.array(
        [
            label not in data.labels[:place]
            for place, (label, item) in enumerate(zip(data.labels, data.recordings, strict=True))
            for part in item.stretches
            if part.usable
            for _ in part.blocks[1:]
        ],
        dtype=bool,
    )
    result = usual.copy()
    for joint, (square, count) in enumerate(zip(squares, counts, strict=True)):
        spread = float(np.sum((square - count * usual[joint] ** 2) ** 2))
        if spread > 0.0:
            freedom = 2.0 * float(np.sum(square)) ** 2 / spread
            of_motions = max(1.0, freedom * float(np.sum(count[once]) / np.sum(count)))
            result[joint] *= np.sqrt(float(fdtri(of_motions, max(1.0, freedom), 1.0 - chance)))
    return result


def noise_signals(observations: Observations, value: Array) -> list[Array]:
    """Return what the noise of positions makes in the torque that parameters predict, of each stretch (n, N), one draw.

    Parameters
    ----------
    value : ndarray, shape (p,)
    """
    model, data = observations.model, noisier(observations.data)
    again = side_by_side(lambda part: model.torque(part.motion, value), data.stretches)
    return [twice - once for once, twice in zip(observations.predicted(value), again, strict=True)]


def _noise_in_blocks(observations: Observations, value: Array) -> tuple[Array, Array]:
    """Return the sum of squares of each joint in each block of time, and of how many samples, both of shape (n, blocks).

    What was found of the last parameters is kept, for more than one ask for it.
    """
    known = _LAST.get(observations)
    if known is None or not np.array_equal(known[0], value):
        squares, counts = [np.zeros((len(observations.joints), 0))], [np.zeros((len(observations.joints), 0))]
        for part, signals in zip(observations.data.stretches, noise_signals(observations, value), strict=True):
            # What a gap leaves of a recording may be all end.
            if not part.usable:
                continue
            made = np.array([part.smooth(joint, signal) for joint, signal in enumerate(signals)])
            used = np.array(part.used)
            squares.append(np.add.reduceat(np.where(used, made, 0.0) ** 2, part.blocks[:-1], axis=1))
            counts.append(np.add.reduceat(used.astype(float), part.blocks[:-1], axis=1))
        known = _LAST[observations] = value.copy(), np.hstack(squares), np.hstack(counts)
    return known[1], known[2]


def noisy(data: PreparedData, derivatives: int = 0) -> bool:
    """Whether the noise of positions is more than negligible in accelerations, or in further derivatives of them."""
    return max(noise_shares(data, derivatives), default=0.0) >= NEGLIGIBLE


def noise_shares(data: PreparedData, derivatives: int = 0) -> list[float]:
    """Return for every moving joint of every recording the share of its acceleration's square that is noise.

    White position noise of variance s^2 at a rate r has the acceleration ``2 s^2 / r (2 pi)^4 f^5 / 5`` up to f, and its k-th
    derivative ``2 s^2 / r (2 pi)^(4 + 2 k) f^(5 + 2 k) / (5 + 2 k)``.

    Parameters
    ----------
    derivatives : int, optional
        How often the acceleration is differentiated further, at most twice.
    """
    order = 2 + derivatives

    def of_recording(item: PreparedRecording, each: tuple[NoiseSizes, ...]) -> list[float]:
        part = item.longest
        sizes, found = each[item.stretches.index(part)], []
        for joint, band in enumerate(data.bands):
            if band is None or not np.any(part.used[joint]):
                continue
            step, level = sizes[joint]
            noise = level**2 + (0.0 if step is None else step**2 / 12.0)
            power = 2.0 * noise / part.rate * (2.0 * np.pi * band) ** (2 * order) * band / (2.0 * order + 1.0)
            motion = part.motion.a[joint]
            if derivatives:
                motion = derivative(motion, part.rate, band, derivatives)
            whole = float(np.mean(motion[part.used[joint]] ** 2))
            found.append(power / whole if whole > 0.0 else 0.0)
        return found

    return list(chain.from_iterable(side_by_side(of_recording, data.recordings, noise_sizes(data))))


def bias_sentence(names: Sequence[str], bias: Array, std: Array) -> str | None:
    """Say which parameters the noise of positions moves by more than their uncertainty without it; None where none.

    Parameters
    ----------
    bias, std : ndarray, shape (p,)
        The standard deviations hold the bias.
    """
    chance = np.sqrt(np.clip(std**2 - bias**2, np.finfo(float).tiny, None))
    moved = [k for k in np.argsort(-np.abs(bias) / chance) if abs(bias[k]) > SPOKEN_OF * chance[k]]
    if not moved:
        return None
    said = listed([f"{names[k]} by about {bias[k]:.2g}" for k in moved], 6)
    return f"the noise of the positions biases {said}; their standard deviations include that bias"
