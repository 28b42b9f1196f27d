"""The benefit of a model: fed forward, and in simulation, before and after the effects that were found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import LostArm, RecordingError, RobotError, ScaraIdentError, UsageError
from scara_ident.export.identified_model import Entry, IdentifiedModel
from scara_ident.manners import listed
from scara_ident.motion.prepared import PreparedStretch, prepare
from scara_ident.motion.recorded_range import faster_than_recorded
from scara_ident.progress import Tell, silent
from scara_ident.recording.recording import Recording
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects import Effect
from scara_ident.simulation.first_run import compiled_first
from scara_ident.simulation.reference import ReferenceMotion
from scara_ident.threads import side_by_side
from scara_ident.use.identified_arm import arm_with, arms_of, by_name, rotor_note, simulated
from scara_ident.use.mujoco_arm import Free, mujoco_arm
from scara_ident.use.rollout import HORIZONS, rollout_errors, virtual_free
from scara_ident.use.tracking import Tracked, at_ticks, foreseen_torque, needed_torque, tracked, urdf_torque
from scara_ident.use.trial_motion import trial_motion

# Arms that may be the true one, drawn about the model.
DRAWS = 3
# An arm drawn so far off that it cannot exist, or be held, is drawn nearer, so many times by half.
HALVINGS = 6


@dataclass(frozen=True, eq=False)
class Use:
    """What `use` found.

    Attributes
    ----------
    model : IdentifiedModel
    motion : ReferenceMotion
        That the arms followed.
    runs : tuple of tuple of Tracked
        For every drawn arm one per feed-forward: ``pid``, ``urdf``, ``identified``, ``effects``.
    horizons : tuple of float
        s.
    rollouts : mapping of str to ndarray of shape (len(horizons), n)
        ``identified`` and ``effects`` in the virtual arm, ``mujoco_identified`` and ``mujoco_effects`` in MuJoCo: rms distance
        from recordings; empty without any.
    not_mujoco : str
        Why there is none in MuJoCo; empty where there is, or without recordings.
    effects, missing : tuple
        Effects that the virtual arm had, and names of those found that it cannot have.
    drawn : tuple of (VirtualArm, tuple of Effect)
        The arms that followed, with their effects.
    feeds : mapping of str to ndarray of shape (n, N)
        Torque fed forward, on the effort side; none for ``pid``.
    notes : tuple of str
        What of the model no virtual arm can have, and where its motion is faster than what it was found on.
    """

    model: IdentifiedModel
    motion: ReferenceMotion
    runs: tuple[tuple[Tracked, ...], ...]
    horizons: tuple[float, ...]
    rollouts: Mapping[str, Array]
    not_mujoco: str
    effects: tuple[Effect, ...]
    missing: tuple[str, ...]
    drawn: tuple[tuple[VirtualArm, tuple[Effect, ...]], ...]
    feeds: Mapping[str, Array]
    notes: tuple[str, ...] = ()

    def rms(self) -> dict[str, Array]:
        """Return the rms tracking error of every joint over all drawn arms, by feed-forward."""
        names = [item.name for item in self.runs[0]]
        return {
            name: np.sqrt(np.mean([run[place].rms ** 2 for run in self.runs], axis=0))
            for place, name in enumerate(names)
        }


def use(
    model: IdentifiedModel,
    motion: ReferenceMotion | None = None,
    recordings: Sequence[Recording] = (),
    *,
    arms: int = DRAWS,
    seed: int = 0,
    progress: Tell = silent,
) -> Use:
    """Say what a model wins as feed-forward and in simulation.

    The arms that follow the motion are not the model: their parameters and effects are drawn about it by its standard
    deviations, and their encoders have steps.

    Parameters
    ----------
    model : IdentifiedModel
    motion : ReferenceMotion, optional
        By default from pose to pose within the limits.
    recordings : sequence of Recording, optional
        With effort; simulated arms with the same torques are compared with them.
    arms : int, optional
        How many are drawn.
    seed : int, optional
    progress : callable, optional

    Returns
    -------
    Use

    Raises
    ------
    RobotError
        If no arm with these parameters can move.
    ScaraIdentError
        If a joint did not move in the recordings that the model was found on.
    UsageError
        If the virtual arm has no such model.
    """
    rows = [item.rows for item in model.training]
    if any(rows) and not all(rows):
        still = listed([joint for joint, count in zip(model.robot.joints, rows, strict=True) if not count], 3)
        raise ScaraIdentError(
            f"{model.robot.name}: {still} did not move in the recordings of the identification, so no arm can be "
            f"simulated with this model; identify it from recordings in which all joints move"
        )
    random = np.random.default_rng(seed)
    pairs, missing = simulated(model.found)
    progress("feed-forward torques", 0.0)
    bare, whole = arms_of(model)
    progress = compiled_first(whole, progress)
    pairs = tuple((effect.resolve(whole), item) for effect, item in pairs)
    effects = tuple(effect for effect, _ in pairs)
    wanted = at_ticks(trial_motion(whole, seed) if motion is None else motion)
    draws = [
        (_drawn(model, whole, random), tuple(_drawn_effect(*pair, whole, random) for pair in pairs))
        for _ in range(arms)
    ]
    drawn: list[tuple[VirtualArm, tuple[Effect, ...]]] = []
    feeds = fed_forward(model, wanted, bare, whole, ())
    runs: list[tuple[Tracked, ...]] = []

    def follow(k: int) -> None:
        # An arm that no controller holds is none that was recorded.
        nearer, own = draws[k]
        for arm in nearer:
            try:
                runs.append(tracked(arm, own, wanted, {"pid": None, **feeds}, seed + k))
            except LostArm as error:
                lost = error
                continue
            drawn.append((arm, own))
            return
        raise lost

    def follow_first() -> None:
        follow(0)

    def learn() -> None:
        learned["effects"] = needed_torque(whole, effects, wanted, foreseen_torque(model, wanted))

    # What effects ask for is learned in one run after the other, so that the first arm moves beside.
    learned: dict[str, Array] = {}
    side_by_side(lambda work: work(), [learn, follow_first] if effects else [follow_first])
    runs[0] += tracked(*drawn[0], wanted, learned, seed)
    feeds |= learned
    for k in range(1, arms):
        progress("following the motion", 0.2 + 0.5 * k / arms)
        follow(k)
    rollouts: dict[str, Array] = {}
    not_mujoco = ""
    if recordings:
        progress("rolling out", 0.7)
        parts = [part for part in prepare(recordings, model.bands).stretches if part.usable]
        if not parts or any(part.stretch.torque is None for part in parts):
            raise RecordingError(f"{recordings[0].name}: too short, or without effort, for a simulation; record longer")
        rollouts["identified"] = _over(parts, virtual_free(bare, ()))
        if effects:
            rollouts["effects"] = _over(parts, virtual_free(whole, effects))
        progress("rolling out in MuJoCo", 0.85)
        variants = {"mujoco_identified": model.without_effects()} | ({"mujoco_effects": model} if model.found else {})
        for name, which in variants.items():
            try:
                with mujoco_arm(which) as free:
                    rollouts[name] = _over(parts, free)
            except ScaraIdentError as error:
                not_mujoco = str(error)
    speed = np.max(np.abs(wanted.velocity), axis=1)
    notes = tuple(filter(None, [rotor_note(model), faster_than_recorded(model.reached, speed, model.robot)]))
    return Use(model, wanted, tuple(runs), HORIZONS, rollouts, not_mujoco, effects, missing, tuple(drawn), feeds, notes)


def _over(parts: Sequence[PreparedStretch], free: Free) -> Array:
    """Return the rms of rollout errors over stretches, shape (len(horizons), n)."""
    each = np.array([rollout_errors(free, part) for part in parts])
    # No stretch may be long enough for the longest horizon.
    count = np.sum(~np.isnan(each), axis=0)
    square = np.nansum(each**2, axis=0)
    return np.asarray(np.sqrt(np.divide(square, count, out=np.full(square.shape, np.nan), where=count > 0)))


def fed_forward(
    model: IdentifiedModel, motion: ReferenceMotion, bare: VirtualArm, whole: VirtualArm, effects: Sequence[Effect]
) -> dict[str, Array]:
    """Return the torque that each model feeds forward, shape (n, N): ``urdf``, ``identified`` and, where any, ``effects``.

    Parameters
    ----------
    model : IdentifiedModel
    motion : ReferenceMotion
        At the ticks of the controller.
    bare, whole : VirtualArm
        See `arms_of`.
    effects : sequence of Effect
        The effects found, as the virtual arm has them.
    """
    feeds = {"urdf": urdf_torque(whole, motion), "identified": needed_torque(bare, (), motion)}
    if effects:
        feeds["effects"] = needed_torque(whole, effects, motion, foreseen_torque(model, motion))
    return feeds


def _drawn(model: IdentifiedModel, whole: VirtualArm, random: np.random.Generator) -> Iterator[VirtualArm]:
    """Draw an arm about the model; give it, and nearer and nearer ones, where they can exist; the last is the model's."""
    value = by_name(model, model.value)
    step = {name: std * random.normal() for name, std in by_name(model, model.std).items() if name in value}

    def nearer() -> Iterator[VirtualArm]:
        for share in 0.5 ** np.arange(HALVINGS):
            moved = {name: x + share * step.get(name, 0.0) for name, x in value.items()}
            with suppress(RobotError):
                yield replace(arm_with(model.robot, moved, model.standard), controller=whole.controller)
        yield whole

    return nearer()


def _drawn_effect(effect: Effect, found: Entry, arm: VirtualArm, random: np.random.Generator) -> Effect:
    """Draw an effect about what was found; where that is out of its bounds it is as found."""
    names = effect.parameter_names()
    moved = {
        names[key]: getattr(effect, names[key]) + float(entry["std"]) * random.normal()
        for key, entry in found["parameters"].items()
        if key in names and entry.get("std") is not None and np.isfinite(entry["std"])
    }
    try:
        return replace(effect, **moved).resolve(arm)
    except UsageError:
        return effect
