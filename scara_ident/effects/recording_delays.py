"""Delays of the effort that differ from recording to recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.filters.late_turn import lacking
from scara_ident.effects.following import EstimateSlopes
from scara_ident.effects.friction import friction_of, friction_places
from scara_ident.effects.measurement import DELAY_STEP, SAMPLING, TimeDelay
from scara_ident.effects.parameters import Member, Parameter, deviation
from scara_ident.effects.signals import Scene, Signals
from scara_ident.estimation.run_variation import MIN_RUNS
from scara_ident.model.terms import Column

# A column for each recording on the rows of all: of so many recordings as many numbers as the rigid body of six joints has.
# Of more the delay of all is corrected alone, and that they differ is said.
MAX_RECORDINGS = 36


class DelayOfEachRecording(TimeDelay):
    """Effort of all joints that is recorded later than position, with a different delay in each recording.

    Clocks that are started again for each recording, or a logger that waits, cause such delays. A single delay for all
    recordings is their mean, and the rest then looks like elastic gears. The effect is added if the joints agree that
    the recordings differ, see `scara_ident.estimation.shared_delays`, and the data are corrected as for a delay of all
    recordings; the delay of a held-out recording is estimated from its first part. Each delay is estimated in the lower
    part of the band: if a controller damps by differences of coarse positions, their noise in the torque and in the
    column would cause delays of milliseconds in recordings with little motion.

    The times at which friction changes sign are used by no column: the samples of a jump are wrong by up to half an
    interval, and friction that builds up over a distance is late too. The correction of a real delay shifts these times
    as well.
    """

    summary = "effort that is recorded later than position, with a different delay in each recording"
    of_each_recording = True

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return one for all joints, of recordings that are enough to say that they differ."""
        return (Member(None),) if MIN_RUNS <= len(scene.start) <= MAX_RECORDINGS else ()

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the delay of each recording."""
        return tuple(
            Column(f"delay_{name}", None, "s", f"delay of the effort of all joints behind position in {name}")
            for name in scene.start
        )

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``-du/dt`` of the predicted torque less Coulomb friction in the recording whose delay it is, else zero."""
        coulomb = [friction_of(signals.scene, joint).get(0, 0.0) for joint in range(signals.scene.robot.n)]
        own = lacking(signals, signals.predicted - np.array(coulomb)[:, None] * signals.sign)
        nothing = np.zeros_like(own)
        return [own if name == signals.motion.name else nothing for name in signals.scene.start]

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return what each of the base model's columns but Coulomb friction lacks in its recording."""
        scene = signals.scene
        own = value[[name == signals.motion.name for name in scene.start]]
        if not len(own):
            return {}
        coulomb = [friction_places(scene, joint).get(0, -1) for joint in range(scene.robot.n)]
        found = super().estimate_slopes(signals, member, own)
        return {joint: (places, rows * ~np.isin(places, coulomb)[:, None]) for joint, (places, rows) in found.items()}

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where no loop is that late."""
        place = int(np.argmax(np.abs(value) - DOUBT_STDS * std))
        return super().inadmissible(scene, member, value[place : place + 1], std[place : place + 1])

    def settled(self, value: Array) -> bool:
        """Whether the delay of every recording is."""
        return super().settled(value[np.argmax(np.abs(value))][None])

    def negligible(self, scene: Scene, member: Member, value: Array) -> str | None:
        """Say so where that of no recording is longer than a sample."""
        if len(value) == 1 or _one(value):
            return super().negligible(scene, member, np.mean(value, keepdims=True))
        if float(np.max(np.abs(value))) * scene.rate > SAMPLING:
            return None
        return (
            f"effort and position are {1e3 * float(np.min(value)):+.2g} to {1e3 * float(np.max(value)):+.2g} ms apart, "
            f"differently in each recording, by less than one sample"
        )

    def alike(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the mean of the recordings, with their scatter as what it is unsure by."""
        count = len(value)
        apart = float(np.var(value, ddof=1)) if count > 1 else 0.0
        return np.mean(value, keepdims=True), np.full((1, 1), np.mean(covariance) + apart / count)

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> None:
        """Return nothing: what else is fitted may jump where friction does."""

    def distinguished_from(self, scene: Scene, member: Member) -> tuple[()]:
        """Return nothing: when friction turns is in no column of it."""
        return ()

    def leaves(self, scene: Scene, member: Member, value: Array) -> tuple[Effect, Member, float] | None:
        """Return the rest of a filter if positions, or efforts, are late in all recordings; clocks are late in some by chance."""
        alike = np.all(value < 0.0) or np.all(value > 0.0)
        return super().leaves(scene, member, np.mean(value, keepdims=True)) if alike else None

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say so where they do not differ, and which of both is late where the mean is negative."""
        said = "; here the delay is the same in all" if _one(value) else ""
        return said + super().or_else(scene, member, np.mean(value, keepdims=True))

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the mean delay, and that of each recording where they differ."""
        mean, unsure = self.alike(value, covariance)
        if _one(value):
            return {"delay": Parameter(float(mean[0]), deviation(unsure), "s")}
        each = super().parameters(scene, member, value, covariance)
        return {"delay": Parameter(float(mean[0]), deviation(unsure), "s"), **each}


def _one(value: Array) -> bool:
    """Return whether the delays differ by less than what data are corrected to: they were drawn to their mean."""
    return len(value) > 1 and float(np.ptp(value)) < DELAY_STEP
