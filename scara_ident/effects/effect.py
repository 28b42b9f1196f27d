"""What an effect is: a term of the torque equation that the base model may lack.

A member of a family has fixed nonlinear parameters and is linear in its coefficients, so that all members of all
families are columns of one regressor. Everything particular to an effect is in its family, a subclass of `Effect`;
estimation, diagnosis and report use it.
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
from scara_ident.effects.following import EstimateSlopes, LinkSlopes, link_slopes_by_differences, slopes_by_differences
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

# Standard deviations by which a coefficient may exceed what a real arm can have.
DOUBT_STDS = 2.0
# Number of values of a nonlinear parameter that are tried by default.
SCAN_POINTS = 5


@dataclass(frozen=True)
class Effect(ABC):
    """A family of terms with one physical cause.

    A subclass defines at least ``name``, ``summary``, ``coefficients`` and `signal_columns`; it then acts on the torque
    of one joint, has one member per moving joint and value of its nonlinear parameters, and its coefficients are its
    physical parameters. A family without fields needs no decorator: instances of one class are equal.

    Attributes
    ----------
    name : str
        Name in the table of effects; families of one cause may share it.
    summary : str
        A short description for the user; may contain the words of `words`.
    coefficients : tuple of Coefficient
    nonlinear : tuple of NonlinearParameter
    all_joints : bool
        Whether the columns of a member with a joint act on the torque of all joints.
    at_rest : bool
        Whether a joint that does not move in the recordings can show it.
    follows_estimate : bool
        Whether the columns depend on the present estimate, ``scene.value`` or ``scene.armatures``.
    on_links : bool
        Whether its torque acts on links, like that of a body or a spring: gears then transmit it, and it is part of `Signals.load`.
    of_position : bool
        Whether its torque on links depends on positions alone, so that its derivatives by speeds are not needed.
    of_load : bool
        Whether the columns are a function of the load of a gear; they are computed again if an effect that acts on links is in the model.
    fitted_first : bool
        Whether it is judged only after a fit with it, because its columns at the estimate without it are poor.
    together, beside_together : bool
        Whether the torque of its members depends on members of other joints in the model, `Scene.together`: the columns of members in the model add
        up to their common torque, and those of another member are the change by it. The second: only its columns depend on these members.
    by_recording, in_intervals : bool
        Whether it acts in some recordings and not in others, see `in_recordings`, or in intervals that its member contains.
    of_each_recording : bool
        Whether each recording of the scene has its own coefficient, about which other recordings contain no information.
    same_at_all_frequencies : bool
        Whether its coefficient is the same in any part of the band; if it differs there, it is another effect.
    after_correction : bool
        Whether it is tried, and named if found, only after a correction that `leaves` it; other rests are never named.
    in_small_ways : bool
        Whether it is determined by small differences of positions, like those between setpoints and true positions.
    of_state : bool
        Whether columns follow from the state at the same sample with arithmetic, sin, cos, exp, abs and sign of numpy, so that code can be exported.
    smooth : bool
        Whether the columns contain no higher frequencies than the filtered motion: they are computed at the samples of `PreparedStretch.decimated`.
    seeded_by : {"order", "frequency"} or None
        The kind of spectral lines of a residual that suggest a member; see `seeds`.
    imitated_by : tuple of Effect
        Imitations in no catalogue that can be confused with it: it is not believed if one of these explains as much and nothing of it is left then.
    watched : bool
        Whether it appears or grows as an arm ages, so that `fleet` tests for it.
    view, experiment : View, str
        The signal over which a figure shows it, and what to record to distinguish it from the others.
    not_simulated : str
        Why the virtual arm does not have it; empty if ``scara_ident.simulation`` has an effect of its name.
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
        """Return the torque on the links with coefficients (k,), shape (n, N), on the side of the recorded torque."""
        found = np.zeros_like(signals.motion.q)
        for x, column in zip(value.tolist(), self._named(signals, member), strict=True):
            found[member.place if np.ndim(column) == 1 else slice(None)] += x * column
        return found

    def link_slopes(self, signals: Signals, member: Member, value: Array, joint: int) -> LinkSlopes:
        """Return the derivatives of `torque_on_links` by the position of a joint, (n, N), and unless `of_position` by its velocity and acceleration."""
        return link_slopes_by_differences(self, signals, member, value, joint)

    def _named(self, signals: Signals, member: Member) -> list[Array]:
        """Return the columns of a member, one for each that `columns` describes."""
        columns = list(self.signal_columns(signals, member))
        described = len(self.columns(signals.scene, member))
        if len(columns) != described:
            raise ScaraIdentError(f"effect {self.name}: {described} coefficients, but {len(columns)} columns")
        return columns

    def rows(self, scene: Scene, member: Member) -> list[int]:
        """Return the indices of the joints on whose torque the columns act."""
        return list(range(scene.robot.n)) if self.all_joints or member.joint is None else [member.joint]

    def joints(self, scene: Scene) -> list[int]:
        """Return the indices of the joints that can have it."""
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
        """Return members for which others may stand, but which these recordings excite too little to be believed."""
        return ()

    def words(self, scene: Scene, member: Member) -> dict[str, Any]:
        """Return the words that `summary` and `coefficients` may contain: joints, their units, nonlinear parameters."""
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
        """Return why coefficients, within two standard deviations, are impossible for a real arm; None if they are possible."""
        for item, x, spread in zip(self.coefficients, value, DOUBT_STDS * std, strict=False):
            if item.positive and x < -spread:
                return item.positive
            if abs(x) > item.largest + spread:
                return item.too_large.format(value=x, **self.words(scene, member))
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Turn coefficients (k,) and their covariance (k, k) into the effect's physical parameters.

        The caller adds the nonlinear parameters with their uncertainty. If `estimated_beside` names a member that was
        found too, its coefficients are appended.
        """
        return {
            column.name: Parameter(float(value[k]), deviation(covariance, k), column.unit)
            for k, column in enumerate(self.columns(scene, member))
        }

    def with_symmetric_powers(self, parameters: Mapping[str, Parameter]) -> Mapping[str, Parameter]:
        """Return all physical parameters with their symmetric powers, if these depend on the other parameters."""
        return parameters

    def estimated_beside(self, scene: Scene, member: Member) -> Member | None:
        """Return the member of this family whose coefficients, if it is found, the physical parameters depend on too."""
        return None

    def description(self, scene: Scene, member: Member) -> str:
        """Return a short description of the effect for the user."""
        return self.summary.format(**self.words(scene, member))

    def or_else(self, scene: Scene, member: Member, value: Array) -> str:
        """Return, for the end of the description, what else an effect with these coefficients may be, given the model's parameters; or ""."""
        return ""

    def or_else_beside(self, member: Member, value: Array, others: Sequence[tuple[Effect, Member, Array]]) -> str:
        """Return what else it may be together with other effects found, given their families, members and coefficients; or ""."""
        return ""

    def gap(self, scene: Scene, member: Member) -> tuple[float, ...]:
        """Return, for every nonlinear parameter, the range of values for which no row changes."""
        return (0.0,) * len(self.nonlinear)

    def resolution(self, scene: Scene, member: Member) -> tuple[float, ...] | None:
        """Return, for every nonlinear parameter, the distance at which two values can be distinguished.

        None: the spacing of the members tried is used.
        """
        return None

    def seeds(self, scene: Scene, joint: int, line: SpectralLine) -> tuple[Member, ...]:
        """Return the members that a line of a joint's residual suggests."""
        return (Member(joint, (line.position,)),) if line.kind == self.seeded_by else ()

    def same_columns(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return members of other families with the same columns on this robot, which need not be tried."""
        return ()

    def in_full(self) -> Effect | None:
        """Return a family with more columns that replaces it once a member passed the tests; None without one."""
        return None

    def in_place_of(self, scene: Scene, effect: Effect, member: Member, value: Array) -> Member | None:
        """Return what to try in the place of a member of another family with impossible coefficients, or that it imitates; None without one."""
        return None

    def other_laws(self) -> tuple[Effect, ...]:
        """Return families of the same cause and parameters with another law, which may replace it if they explain more."""
        return ()

    def law(self) -> Mapping[str, Parameter]:
        """Return the parameters that distinguish the law from the standard one; empty for the standard law."""
        return {}

    def band(self, member: Member) -> float:
        """Return the band, Hz, that contains the frequencies at which a member shows most; 0 if every band does."""
        return 0.0

    def turns_on(self, member: Member) -> tuple[float, float]:
        """Return the shortest travel of its joint, rad or m, and the lowest speed that a member depends on; infinite if none."""
        return np.inf, np.inf

    def knowing(self, unloaded: frozenset[str]) -> Effect:
        """Return the family with the names of recordings without payload."""
        return self

    def in_recordings(self, scene: Scene, member: Member, names: frozenset[str]) -> Member:
        """Return the member that also acts in further recordings of the scene."""
        return member

    def geared_joint(self, member: Member) -> int | None:
        """Return the joint whose gear torque it depends on, and so on the rotor's share of an inertia.

        It then depends on the effects in the model with `on_links` too.
        """
        return None

    def passes_on(self, member: Member, value: Array, driving: float) -> float | None:
        """Return the share of a drive's torque that reaches the links, for ``driving`` from 1 (it drives them) to -1 (they drive it); None: all of it."""
        return None

    def tie(self, scene: Scene, member: Member) -> Tie | None:
        """Return how the only coefficient follows from the nonlinear parameters; None if it is free."""
        return None

    def slopes(self, signals: Signals, member: Member) -> Iterable[tuple[NDArray[np.intp], Array]]:
        """Return, for each joint, on which of the ``p + 1 + s`` of `Tie.slopes` a tied member's torque depends, and its derivatives (k, N).

        Its coefficient is held; places (k,) that are not given have derivatives of zero.
        """
        raise NotImplementedError(f"{self.name} is tied and has no slopes")

    def estimate_slopes(self, signals: Signals, member: Member, value: Array) -> EstimateSlopes:
        """Return the derivatives of an untied member's torque, coefficients (k,) held, by the base model's parameters, which its columns follow."""
        return slopes_by_differences(self, signals, member, value)

    def instead(self, scene: Scene, member: Member) -> tuple[tuple[Member, Member], ...]:
        """Return pairs, the most likely first, whose torque one member alone, on the member's joint, may have absorbed."""
        return ()

    def elsewhere(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return members of the same joint as other starting points of a fit of several that act together."""
        return ()

    def unfound(self, scene: Scene, member: Member) -> tuple[Member, ...]:
        """Return members of other joints that may be there too, but are too small to be found and are absorbed by this one."""
        return ()

    def essential(self, scene: Scene, member: Member) -> slice:
        """Return the coefficients of which at least one is not zero if the effect is there; default: all."""
        return slice(None)

    def read_directly(
        self, scene: Scene, joint: int, recordings: Sequence[PreparedRecording], rotor_std: float
    ) -> Mapping[str, Parameter]:
        """Return a joint's parameters that a separate channel determines without the fit; ``rotor_std`` is a share of its inertia."""
        return {}

    def corrects_data(self, member: Member) -> bool:
        """Whether it is corrected in the recordings instead of becoming a term of the model."""
        return False

    def corrected(self, recording: Recording, member: Member, value: Array) -> Recording:
        """Return a recording without the effect."""
        return recording

    def settled(self, value: Array) -> bool:
        """Whether a further correction of the data is too small to be made."""
        return True

    def negligible(self, scene: Scene, member: Member, value: Array) -> str | None:
        """Return why coefficients are negligible, however significant; None if they are not."""
        return None

    def alike(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the part of coefficients (k,) that is common to all recordings, and its covariance; default: all."""
        return value, covariance

    def of_torque(self, signals: Signals, member: Member, torque: Array) -> Array | None:
        """Return what the torque (n, N) of effects in the model adds to the columns, shape (n, k, N); None if nothing."""
        return None

    def distinguished_from(self, scene: Scene, member: Member) -> tuple[tuple[Effect, Member], ...]:
        """Return an imitation, no property of the arm, that is fitted with it when it is estimated in the lower part of the band."""
        return ()

    def leaves(self, scene: Scene, member: Member, value: Array) -> tuple[Effect, Member, float] | None:
        """Return what may be left of it in corrected recordings, and the band, Hz, above which this hides effects of the arm."""
        return None
