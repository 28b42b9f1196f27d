"""What an effect is: a term of the torque equation that the base model may lack.

A member of a family has fixed nonlinear parameters and is linear in its coefficients, so that all members of all
families are columns of one regressor. All that is particular to an effect is said by its family, a subclass of
`Effect`; estimation, diagnosis and report ask it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.following import EstimateSlopes, slopes_by_differences
from scara_ident.effects.parameters import (
    OWN,
    Coefficient,
    Member,
    NonlinearParameter,
    Parameter,
    SpectralLine,
    Tie,
    View,
    deviation,
)
from scara_ident.effects.signals import Scene, Signals
from scara_ident.errors import ScaraIdentError
from scara_ident.model.terms import Column
from scara_ident.motion.prepared import PreparedRecording
from scara_ident.recording.recording import Recording

# Standard deviations by which a coefficient may lie beyond what a real arm can have.
DOUBT_STDS = 2.0
# Values of a nonlinear parameter that are tried where a family does not say which.
SCAN_POINTS = 5


@dataclass(frozen=True)
class Effect(ABC):
    """A family of terms with one physical cause.

    A subclass gives at least ``name``, ``summary``, ``coefficients`` and `signal_columns`; it then acts on the torque
    of one joint, has one member per moving joint and value of its nonlinear parameters, and its coefficients are its
    physical parameters. A family without fields of its own needs no decorator: those of one class are equal.

    Attributes
    ----------
    name : str
        In the table of effects; families of one cause may share it.
    summary : str
        What it is, in a few words for a person; may hold the words of `words`.
    coefficients : tuple of Coefficient
    nonlinear : tuple of NonlinearParameter
    all_joints : bool
        Whether the columns of a member with a joint act on the torque of all joints.
    at_rest : bool
        Whether a joint that does not move in the recordings can show it.
    follows_estimate : bool
        Whether the columns depend on the present estimate, ``scene.value`` or ``scene.armatures``.
    on_links : bool
        Whether its torque acts on links, as a body's or a spring's: gears then transmit it, and effects with `Signals.load` know it.
    of_position : bool
        Whether its torque on links follows from the positions alone, so that how it changes with speeds need not be asked.
    of_load : bool
        Whether the columns are a function of the load that a gear transmits, and are made again beside an effect that acts on links.
    fitted_first : bool
        Whether it is judged at the estimate fitted with it only: its columns at the estimate without it are poor ones.
    together, beside_together : bool
        Whether what its members do follows from those of other joints in the model too, `Scene.together`: the columns of members in
        it add up to what all of them do, those of another are what it changes beside them; or its columns do, and it is none of these.
    by_recording, in_intervals : bool
        Whether it acts in some recordings and not in others, see `in_recordings`, or in intervals that its member holds.
    of_each_recording : bool
        Whether each recording of the scene has a coefficient of its own, of which no other recording says anything.
    same_at_all_frequencies : bool
        Whether its coefficient is the same in any part of the band, so that another one there says that it is not it.
    after_correction : bool
        Whether it is tried, and named if found, only where a correction `leaves` it, and needs no member; else what that leaves is never named.
    in_small_ways : bool
        Whether it is determined by small differences of positions, as setpoints do from what a controller makes of them.
    of_state : bool
        Whether columns follow from the state at the sample by numpy's arithmetic, sin, cos, exp, abs and sign, as a controller's code can.
    smooth : bool
        Whether the columns have nothing faster than the filtered motion: they are made at `PreparedStretch.decimated` samples.
    seeded_by : {"order", "frequency"} or None
        The lines of a residual's spectrum that suggest a member; see `seeds`.
    imitated_by : tuple of Effect
        What no catalogue has and may be taken for it: it is not believed where one of these does as well and nothing of it is left beside.
    watched : bool
        Whether it comes or grows as an arm ages, so that a fleet is watched for it.
    view, experiment : View, str
        What a figure shows it over, and what to record to bring it out against the others.
    not_simulated : str
        Why the virtual arm does not have it; empty where ``scara_ident.simulation`` has an effect of its name.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    coefficients: ClassVar[tuple[Coefficient, ...]] = ()
    nonlinear: ClassVar[tuple[NonlinearParameter, ...]] = ()
    all_joints: ClassVar[bool] = False
    imitated_by: ClassVar[tuple[Effect, ...]] = ()
    at_rest: ClassVar[bool] = False
    follows_estimate: ClassVar[bool] = False
    on_links: ClassVar[bool] = False
    of_position: ClassVar[bool] = False
    of_load: ClassVar[bool] = False
    fitted_first: ClassVar[bool] = False
    together: ClassVar[bool] = False
    beside_together: ClassVar[bool] = False
    by_recording: ClassVar[bool] = False
    in_intervals: ClassVar[bool] = False
    of_each_recording: ClassVar[bool] = False
    same_at_all_frequencies: ClassVar[bool] = False
    after_correction: ClassVar[bool] = False
    in_small_ways: ClassVar[bool] = False
    of_state: ClassVar[bool] = False
    smooth: ClassVar[bool] = False
    seeded_by: ClassVar[Literal["order", "frequency"] | None] = None
    watched: ClassVar[bool] = False
    view: ClassVar[View] = OWN
    experiment: ClassVar[str] = "record the same path at two speeds, in both directions, with and without a payload"
    not_simulated: ClassVar[str] = ""

    @abstractmethod
    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return the columns on the side of the recorded torque: (N,) on the member's joint, or (n, N) on all."""

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return the columns of a member, shape (n, k, N), on the side of the recorded torque."""
        result = np.zeros((signals.scene.robot.n, len(self.columns(signals.scene, member)), signals.motion.samples))
        for joint, columns in self.by_joint(signals, member).items():
            result[joint] = columns
        return result

    def by_joint(self, signals: Signals, member: Member) -> dict[int, list[Array]]:
        """Return the k columns of a member, (N,) each, on every joint that they act on, by the joint's place."""
        columns = [np.asarray(column) for column in self._named(signals, member)]
        shapes = (signals.motion.samples,), (signals.scene.robot.n, signals.motion.samples)
        for k, column in enumerate(columns):
            if column.shape not in shapes:
                raise ScaraIdentError(
                    f"effect {self.name}: column {k} has shape {column.shape}; expected {shapes[0]} for the member's joint or "
                    f"{shapes[1]} for all joints"
                )
        joints = self.rows(signals.scene, member)
        return {j: [column if column.ndim == 1 else column[j] for column in columns] for j in joints}

    def fill(self, signals: Signals, member: Member, rows: Sequence[Array]) -> None:
        """Write the columns into those of each joint: (k, N) where they act, (0, N) where they do not."""
        columns = self._named(signals, member)
        for joint in self.rows(signals.scene, member):
            for k, column in enumerate(columns):
                rows[joint][k] = column if np.ndim(column) == 1 else column[joint]

    def torque_on_links(self, signals: Signals, member: Member, value: Array) -> Array:
        """Return what coefficients (k,) do to the links of an arm, shape (n, N), on the side of the recorded torque."""
        found = np.zeros_like(signals.motion.q)
        for x, column in zip(value.tolist(), self._named(signals, member), strict=True):
            found[member.place if np.ndim(column) == 1 else slice(None)] += x * column
        return found

    def _named(self, signals: Signals, member: Member) -> list[Array]:
        """Return the columns of a member, one for each that `columns` describes."""
        columns = list(self.signal_columns(signals, member))
        described = len(self.columns(signals.scene, member))
        if len(columns) != described:
            raise ScaraIdentError(f"effect {self.name}: {described} coefficients, but {len(columns)} columns")
        return columns

    def rows(self, scene: Scene, member: Member) -> list[int]:
        """Return the places of the joints whose torque the columns act on."""
        return list(range(scene.robot.n)) if self.all_joints or member.joint is None else [member.joint]

    def joints(self, scene: Scene) -> list[int]:
        """Return the places of the joints that can have it."""
        return [j for j in range(scene.robot.n) if self.at_rest or (scene.speed[j] > 0.0 and scene.travel[j] > 0.0)]

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return the values of the nonlinear parameters that are tried on a joint."""
        spaced = [np.geomspace if item.logarithmic else np.linspace for item in self.nonlinear]
        pairs = zip(spaced, self.nonlinear, strict=True)
        grids = [grid(item.lower, item.upper, SCAN_POINTS + 2)[1:-1] for grid, item in pairs]
        return (tuple(float(x) for x in values) for values in product(*grids))

    def limits(self, scene: Scene, member: Member) -> tuple[tuple[float, float], ...]:
        """Return the smallest and largest value of every nonlinear parameter on the member's joint."""
        joint = member.joint
        unit = [1.0 if joint is None or not item.of_length else float(scene.radian[joint]) for item in self.nonlinear]
        return tuple((x * item.lower, x * item.upper) for x, item in zip(unit, self.nonlinear, strict=True))

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return the members worth trying on this robot and these recordings."""
        return tuple(Member(j, values) for j in self.joints(scene) for values in self.scan(scene, j))

    def doubtful(self, scene: Scene) -> tuple[Member, ...]:
        """Return members that others may stand for, but of which these recordings hold too little to believe them."""
        return ()

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Return what `summary` and `coefficients` may name: joints, their units, nonlinear parameters."""
        robot = scene.robot
        found: dict[str, Any] = {"joint": "all joints"}
        found |= {item.name: value for item, value in zip(self.nonlinear, member.nonlinear, strict=True)}
        if member.joint is not None:
            j = member.joint
            found |= {"joint": robot.joints[j], "torque": robot.torque_unit(j), "position": robot.position_unit(j)}
            if member.partner is not None:
                found["partner"] = robot.joints[member.partner]
        return found

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Describe the k columns of a member."""
        words = self.words(scene, member)
        joint = None if member.joint is None else scene.robot.joints[member.joint]
        return tuple(
            Column(item.name, joint, item.unit.format(**words), item.meaning.format(**words), bool(item.positive))
            for item in self.coefficients
        )

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say why coefficients, two standard deviations given them, cannot be those of a real arm; None where they can."""
        for item, x, spread in zip(self.coefficients, value, DOUBT_STDS * std, strict=False):
            if item.positive and x < -spread:
                return item.positive
            if abs(x) > item.largest + spread:
                return item.too_large.format(value=x, **self.words(scene, member))
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Turn coefficients (k,) and their covariance (k, k) into the effect's physical parameters.

        The nonlinear parameters are added by the caller, who knows how sure they are. Where `estimated_beside` names a member
        that was found too, its coefficients follow.
        """
        return {
            column.name: Parameter(float(value[k]), deviation(covariance, k), column.unit)
            for k, column in enumerate(self.columns(scene, member))
        }

    def with_symmetric_powers(self, parameters: Mapping[str, Parameter]) -> Mapping[str, Parameter]:
        """Return physical parameters, nonlinear ones too, with the power of each that the data tell, where others decide that."""
        return parameters

    def estimated_beside(self, scene: Scene, member: Member) -> Member | None:
        """Return the member of this family by whose coefficients too, where it is found, the physical parameters are."""
        return None

    def description(self, scene: Scene, member: Member) -> str:
        """Say in a few words what the effect is, for a person."""
        return self.summary.format(**self.words(scene, member))

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Say after the description what else an effect of these coefficients may be, by the model's parameters with it; or ""."""
        return ""

    def or_else_beside(self, member: Member, value: Array, others: Sequence[tuple[Effect, Member, Array]]) -> str:
        """Say what else it may be together with another found: families, members and coefficients of these are given; or ""."""
        return ""

    def gap(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return, for every nonlinear parameter, how wide a range of its values leaves every row the same."""
        return (0.0,) * len(self.nonlinear)

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...] | None:
        """Return, for every nonlinear parameter, how far apart two values must be to be told apart.

        None where the spacing of the members tried says it.
        """
        return None

    def seeds(self, scene: Scene, joint: int, line: SpectralLine) -> tuple[Member, ...]:
        """Return the members that a line of a joint's residual suggests."""
        return (Member(joint, (line.position,)),) if line.kind == self.seeded_by else ()

    def same_columns(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return members of other families that have a member's columns on this robot, and that no scan need try."""
        return ()

    def in_full(self) -> Effect | None:
        """Return a family with more columns that may take its place once a member is to be believed; None without one."""
        return None

    def in_place_of(self, scene: Scene, effect: Effect, member: Member, value: Array) -> Member | None:
        """Return what to try in the place of one of another family whose coefficients are those of no arm; None without one."""
        return None

    def other_laws(self) -> tuple[Effect, ...]:
        """Return families of the same cause and parameters by another law, which may take its place where they explain more."""
        return ()

    def law(self) -> Mapping[str, Parameter]:
        """Return what tells the law from that of the effect's name; nothing where it is that one."""
        return {}

    def band(self, member: Member) -> float:
        """Return the band, Hz, that holds where a member shows most; 0 where every band does."""
        return 0.0

    def turns_on(self, member: Member) -> tuple[float, float]:
        """Return the shortest way of its joint, rad or m, and the lowest speed that a member turns on; infinite where none does."""
        return np.inf, np.inf

    def knowing(self, unloaded: frozenset[str]) -> Effect:
        """Return the family that knows the names of recordings in which the arm carries nothing."""
        return self

    def in_recordings(self, scene: Scene, member: Member, names: frozenset[str]) -> Member:
        """Return the member that also acts in further recordings of the scene."""
        return member

    def geared_joint(self, member: Member) -> int | None:
        """Return the joint on the torque behind whose gear it depends, and so on the rotor's share of an inertia.

        It then depends on the effects in the model with `on_links` too.
        """
        return None

    def passes_on(self, member: Member, value: Array, driving: float) -> float | None:
        """Return the share of a drive's torque that reaches links, driving from 1, them, to -1, driven by them; None for all."""
        return None

    def tie(self, scene: Scene, member: Member) -> Tie | None:
        """Return what the only coefficient is by the nonlinear parameters; None where it is free."""
        return None

    def slopes(self, signals: Signals, member: Member) -> Iterable[tuple[NDArray[np.intp], Array]]:
        """Give of each joint by which of the ``p + 1 + s`` of `Tie.slopes` a tied member's torque changes, and its derivatives (k, N).

        Its coefficient is held; places (k,) that are not given have derivatives of zero.
        """
        raise NotImplementedError(f"{self.name} is tied and has no slopes")

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return the derivatives of an untied member's torque, its coefficients (k,) held, by the base model's parameters.

        Asked of a family with `follows_estimate`. Unless it says them, differences of its columns do, which takes longer.
        """
        return slopes_by_differences(self, signals, member, value)

    def instead(self, scene: Scene, member: Member) -> tuple[tuple[Member, Member], ...]:
        """Return pairs, the likeliest first, of which one alone, of the member's joint and first, may have taken up what both do."""
        return ()

    def elsewhere(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return members of the same joint from which a fit of several that act together may end in another minimum."""
        return ()

    def unfound(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return members of other joints that may be there too, and of which this one takes up what is too small to be found."""
        return ()

    def essential(self, scene: Scene, member: Member) -> slice:
        """Return the coefficients of which one at least is not zero where the effect is there: all, unless one says it."""
        return slice(None)

    def read_directly(
        self, scene: Scene, joint: int, recordings: Sequence[PreparedRecording], rotor_std: float
    ) -> Mapping[str, Parameter]:
        """Return a joint's parameters that a channel of its own tells without the fit, ``rotor_std`` a share of its inertia."""
        return {}

    def corrects_data(self, member: Member) -> bool:
        """Whether it is taken out of the recordings instead of becoming a term of the model."""
        return False

    def corrected(self, recording: Recording, member: Member, value: Array) -> Recording:
        """Return a recording without the effect."""
        return recording

    def settled(self, value: Array) -> bool:
        """Whether a further correction of the data is too small to be made."""
        return True

    def negligible(self, scene: Scene, member: Member, value: Array) -> str | None:
        """Say why coefficients are too small to speak of, however sure; None where they are not."""
        return None

    def alike(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """Return what of coefficients (k,) all recordings have alike, and its covariance: all, unless each has its own."""
        return value, covariance

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> Array | None:
        """Return what the torque (n, N) of effects in the model adds to the columns, shape (n, k, N); None where that is nothing."""
        return None

    def distinguished_from(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return what is no part of an arm and may look like it in the lower part of the band, beside which it is estimated there."""
        return ()

    def leaves(self, scene: Scene, member: Member, value: Array) -> tuple[Effect, Member, float] | None:
        """Return what may be left of it in corrected recordings, and the band, Hz, beyond which that hides what the arm does."""
        return None
