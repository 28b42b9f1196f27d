"""Make the gallery of effects: docs/gallery.md and a picture of each effect, from recordings of virtual arms.

Every effect of the registry is put on a virtual arm whose recordings are then diagnosed twice: with all effects, which
gives the picture and the parameters, and with all others, which shows what it would be taken for. What an effect is, is
taken from the docstring of its class and from docs/theory.md.

    python docs/gallery.py            # all, in some minutes
    python docs/gallery.py spring     # one
    python docs/gallery.py --words    # no picture: only the words of the classes, when they have changed
"""

from __future__ import annotations

import inspect
import re
import string
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident import diagnose, load_robot, named_motion, parse_effect, simulate, virtual_arm
from scara_ident.arrays import Array
from scara_ident.diagnosis import Diagnosis
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.effects import CATALOGUE, Effect, Member, Signals
from scara_ident.effects.parameters import Parameter
from scara_ident.motion.motion import Motion
from scara_ident.recording.recording import Recording
from scara_ident.report.drawing import canvas
from scara_ident.report.html.diagnosis import DiagnosisContext
from scara_ident.report.html.story import ADDED, LAW, LEFT, SIGNALS, chapter_group
from scara_ident.report.plot import Figure, Layer, Line, Plot
from scara_ident.robot.description import RobotDescription
from scara_ident.robot.examples import example_urdf
from scara_ident.robot.robot import Robot, build_robot
from scara_ident.simulation import ReferenceMotion, sampled

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "gallery.md"
PICTURES = DOCS / "figures" / "effects"
# In inches; dots per inch; colours that a picture keeps; pixels of white about it.
WIDTH, DPI, SHADES, MARGIN = 5.4, 150, 48, 8
RATE = 250.0
SHORT = {
    LEFT: "left by the rest",
    LAW: "as found",
    ADDED: "what it adds",
    "residual before": "before",
    "residual after": "after",
}

HEAD = """# Gallery of effects

Every effect that the diagnosis knows, with its typical picture: each was put on a virtual arm, and the recordings were
diagnosed. Orange is the residual without the effect, blue with it; dashed is what the effect adds to the prediction. In
the upper panel green is the torque that the rest of the model leaves to the effect, dotted the identified effect. Bands
are two standard errors. *Taken for* is what the diagnosis of the same recordings finds when the effect is not in the
catalogue: the effects that it can be confounded with. If nothing is found and the verdict is `complete`, the effect is
missed: without it the residual looks like noise, or like differences between runs ([limits](diagnosis.md#the-verdict)).
With less excitation more effects look alike; see [Groups](diagnosis.md#groups). The columns are explained in
[Theory](theory.md#effects).

This page is written by `python docs/gallery.py` from the docstrings of the effects' classes. To add an effect: [My own
effect](howto/my-own-effect.md).
"""


@dataclass(frozen=True)
class Case:
    """An effect as the virtual arm has it, or as a torque added to its recordings; on the SCARA03, or on joints of another arm."""

    hidden: str = ""
    joints: tuple[str, ...] = ()
    rate: float = RATE
    added: tuple[Effect, Member, tuple[float, ...]] | None = None
    urdf: str = "ur5"


def _families(name: str) -> list[Effect]:
    return [effect for effect in CATALOGUE if effect.name == name]


def _only(name: str) -> Effect:
    return _families(name)[0]


WRIST = ("wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
LIFT = ("torso_lift_joint", "arm_1_joint")
UPPER_ARM = ("shoulder_lift_joint", "elbow_joint")
# All others are as `simulate --effect NAME` has them.
CASES = {
    "encoder_eccentricity": Case("encoder_eccentricity:joint1:amplitude=0.0001", rate=500.0),
    "smooth_coulomb": Case("smooth_coulomb:elbow_joint", UPPER_ARM),
    "backlash": Case("backlash:joint1:width=0.004"),
    "time_delay": Case("time_delay:delay=0.012"),
    "torque_filter": Case("torque_filter:time_constant=0.02", rate=500.0),
    "position_filter": Case("position_filter:time_constant=0.02", rate=500.0),
    "joint_zero": Case("joint_zero:shoulder_lift_joint:offset=0.3", UPPER_ARM),
    "joint_elasticity": Case("joint_elasticity:joint1:stiffness=2500"),
    "coupled_shaft": Case("coupled_shaft", WRIST),
    "rope_weight": Case(joints=LIFT, urdf="tiago_no_hand", added=(_only("rope_weight"), Member(0), (12.0,))),
    "inertia_coupling": Case(joints=WRIST, added=(_only("inertia_coupling"), Member(1, (), 2), (0.02,))),
    "gravity_counterbalance": Case(joints=UPPER_ARM, added=(_only("gravity_counterbalance"), Member(1), (6.0, 3.0))),
    "drive_coupling": Case(added=(_only("drive_coupling"), Member(0, (), 1), (0.15,))),
}


# What a class's words leave open, in general.
GENERAL = {
    "joint": "the joint",
    "partner": "another joint",
    "order": "so many",
    "frequency": "one frequency",
    "source": "another joint's velocity, or a sum or difference with it",
    "recordings": "some recordings",
    "way": "the sum or difference of ",
}


class _Words(string.Formatter):
    """Fills what a class's words leave open."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        return GENERAL[field_name], field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        return str(value)


def words(name: str) -> list[str]:
    """Return what the classes of an effect say of it: summary, its description, and the experiment that settles it."""
    families = {type(effect): effect for effect in _families(name)}
    first = next(iter(families.values()))
    told = [f"**{_sentence(_Words().format(first.summary))}**"]
    told += [_described(kind) for kind in families]
    return [*told, f"**Settled by:** {first.experiment}."]


def _sentence(text: str) -> str:
    text = text.replace("frequency Hz", "frequency")
    return f"{text[:1].upper()}{text[1:]}."


def _described(kind: type[Effect]) -> str:
    """Return a class's description as Markdown, without its list of attributes."""
    text = inspect.cleandoc(kind.__doc__ or "").split("\nAttributes\n")[0]
    return text.strip()


def equation(name: str) -> str:
    """Return an effect's row in the table of the page on theory: its columns, and its nonlinear parameters."""
    theory = (DOCS / "theory.md").read_text(encoding="utf-8")
    row = next(line for line in theory.splitlines() if line.startswith(f"| `{name}` |"))
    _, columns, nonlinear = (cell.strip() for cell in row.strip("|").split(" | "))
    nonlinear = nonlinear.strip("| ")
    return f"**Columns:** {columns}" + (f"; nonlinear: {nonlinear}" if nonlinear else "") + "."


def look_for(effect: Effect) -> str:
    """Say over which signal an effect shows itself."""
    signal = effect.view.signal
    over = {
        "order": "a line in the spectrum over motor turns",
        "frequency": "a line in the spectrum over frequency",
    }.get(signal, "a residual that follows the effect's own torque; no one signal shows it")
    if signal in SIGNALS:
        over = f"the residual over {SIGNALS[signal][0]}" + (", in the direction of motion" if effect.view.along else "")
    return f"**Look for:** {over}."


def names() -> list[str]:
    """Return the names of all effects built in, in order."""
    return list(dict.fromkeys(effect.name for effect in CATALOGUE))


def _arm(name: str, joints: Sequence[str]) -> Robot:
    """Return an example's arm whose other joints are locked."""
    urdf = example_urdf(name)
    return build_robot(RobotDescription(urdf=urdf, effort_side="joint", joints=dict.fromkeys(joints)), urdf)


def sines(robot: Robot, seed: int, name: str, seconds: float = 20.0) -> ReferenceMotion:
    """Return a motion of five harmonics a joint, about the middle of its range."""
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.5, 1.0, (2, robot.n, 5))
    middle = np.array([-1.2, 1.2, 0.5])[: robot.n, None]
    # A joint that slides stays within three quarters of its range, which is shorter than what joints turn by.
    slides, reach = robot.prismatic[:, None], 0.5 * (robot.upper - robot.lower)[:, None]
    middle = np.where(slides, (robot.lower[:, None] + reach), middle)
    size = np.where(slides, 0.25 * reach, 1.0) * size

    def motion(time: Array) -> tuple[Array, Array, Array]:
        q, v, a = middle + 0.0 * time, 0.0 * middle * time, 0.0 * middle * time
        for k in range(1, 6):
            w, share = 2.0 * np.pi * k / seconds * 1.7, 0.9 * size[:, k - 1, None] / (1.0 + 0.5 * k)
            angle = w * time + 2.0 * np.pi * phase[:, k - 1, None]
            q, v, a = q + share * np.sin(angle), v + share * w * np.cos(angle), a - share * w * w * np.sin(angle)
        return q, v, a

    return sampled(name, robot, motion, seconds)


def recordings(name: str) -> tuple[Robot, list[Recording], str]:
    """Record the virtual arm of an effect on three motions, twice each; return robot, recordings and what was hidden."""
    case = CASES.get(name, Case(name))
    robot = _arm(case.urdf, case.joints) if case.joints else load_robot()
    arm = virtual_arm(robot)
    if not case.joints:
        motions = [named_motion(word, robot) for word in ("OJD", "OJK", "L1")]
    else:
        motions = [sines(robot, seed, f"sines{seed}") for seed in (1, 2, 3)]
    effects = [parse_effect(case.hidden)] if case.hidden else []
    runs = [
        simulate(arm, motion, effects=effects, rate=case.rate, seed=seed, repetition=repetition)
        for motion in motions
        for seed, repetition in ((1, 1), (2, 2))
    ]
    if case.added is None:
        (hidden,) = (effect.as_dict() for effect in runs[0].effects)
        said = ", ".join(f"{key} {_value(value)}" for key, value in hidden["parameters"].items() if value is not None)
        joint = "" if hidden["joint"] is None else f" on {hidden['joint']}"
        return robot, [run.recording for run in runs], f"{said}{joint}"
    effect, member, value = case.added
    scene = diagnose(robot, [run.recording for run in runs], catalogue=[]).search.scene
    found = []
    for run in runs:
        true = run.true
        motion = Motion(
            run.motion.name, run.recording.name, run.recording.time, true.position, true.velocity, true.acceleration, None, case.rate,
        )  # fmt: skip
        torque = np.einsum("jkn,k->jn", effect.regressor(Signals(scene, motion), member), np.array(value))
        found.append(replace(run.recording, effort=run.recording.effort + torque))
    parts = zip(effect.coefficients, value, strict=True)
    said = ", ".join(f"{coefficient.name} {_value(x)}" for coefficient, x in parts)
    return robot, found, f"{said} on {robot.joints[member.place]}, added to the recorded torque: {effect.not_simulated}"


def _value(value: Any) -> str:
    if isinstance(value, (bool, str)):
        return str(value).lower()
    return f"{value:.3g}" if isinstance(value, float) else "/".join(f"{x:.3g}" for x in value)


def figure(diagnosis: Diagnosis, name: str) -> tuple[FoundEffect, Figure]:
    """Return an effect that was found and the figure that tells it best: its residual, before and after."""
    effect, chapter = next(item for item in DiagnosisContext(diagnosis).chapters if item[0].effect == name)
    told = chapter_group(diagnosis.robot, chapter).figures[0]
    ((key, plot),) = told.variants.items()
    assert isinstance(plot, Plot)
    panels = tuple(
        replace(panel, layers=[_short(layer) for layer in panel.layers], height=130) for panel in plot.panels
    )
    return effect, replace(told, variants={key: replace(plot, panels=panels)})


def _short(layer: Layer) -> Layer:
    """Return a layer with the short name that a narrow picture has room for."""
    return replace(layer, name=SHORT[layer.name]) if isinstance(layer, Line) and layer.name in SHORT else layer


def draw(path: Path, told: Figure) -> None:
    """Draw a figure with few colours, which keeps the file small."""
    from PIL import Image, ImageOps

    canvas("", [[told]], min_width=WIDTH).savefig(path, dpi=DPI)
    with Image.open(path) as image:
        full = image.convert("RGB")
    # Without the white about it.
    box = ImageOps.invert(full).getbbox()
    assert box is not None
    small = ImageOps.expand(full.crop(box), MARGIN, "white").quantize(SHADES, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def stand_ins(robot: Robot, runs: Sequence[Recording], name: str, effect: FoundEffect) -> str:
    """Say what is found in the place of an effect when it is not tried."""
    found = diagnose(robot, runs, catalogue=[family for family in CATALOGUE if family.name != name])
    # The rest of a correction exists only together with the correction.
    needed = [item.effect for item in found.effects if _only(item.effect).corrects_data(Member(None))]
    needed = needed if _only(name).after_correction else []
    others = [item for item in found.effects if item.effect not in needed]
    labels = [f"`{item.effect}`" + (f" of {item.joint}" if item.joint else "") for item in others]
    if not labels:
        beside = f" beside `{needed[0]}`" if needed else ""
        missed = f": it is missed, though it removes {_removed(effect)}" if found.verdict == "complete" else ""
        noted = [note for note in found.notes if " lags by " in note] if missed else []
        return (
            f"**Taken for:** nothing{beside}; the verdict is then `{found.verdict}`{missed}"
            + (f". A note says: {'; '.join(noted)}" if noted else "")
            + "."
        )
    rest = _squares(found, robot)
    start, own = rest[0], sum((effect.after[j] or 0.0) ** 2 / (effect.before[j] or 1.0) ** 2 for j in robot.joints)
    share = (start - rest[1]) / max(start - own, 1e-12)
    removes = f"{share:.0%} of what the effect removes" if share > 0.0 else "nothing over all joints"
    return f"**Taken for:** {', '.join(labels)}, which removes {removes}; the verdict is then `{found.verdict}`."


def computed_of(name: str, robot: Robot, runs: Sequence[Recording], hidden: str, effect: FoundEffect) -> str:
    """Return what the page says of an effect that was computed."""
    return f"{here(effect, hidden)}\n\n{stand_ins(robot, runs, name, effect)}"


def _removed(effect: FoundEffect) -> str:
    """Say how much of a joint's squared residual an effect removes, where that is most."""
    shares = {j: 1.0 - ((effect.after[j] or 0.0) / b) ** 2 for j, b in effect.before.items() if b}
    most = max(shares, key=lambda joint: shares[joint])
    return f"{shares[most]:.0%} of the squared residual of {most}"


def _squares(found: Diagnosis, robot: Robot) -> tuple[float, float]:
    """Return the squared residual over all joints before and after, each over its own before."""
    before = found.before.errors(found.training_before)
    after = found.after.errors(found.training_after)
    pairs = list(zip(before, after, strict=True))
    return float(len(pairs)), sum((b.rms / a.rms) ** 2 for a, b in pairs)


def here(found: FoundEffect, hidden: str) -> str:
    """Say what was hidden and what was found."""
    parts = ", ".join(f"{key} {_quantity(parameter)}" for key, parameter in found.parameters.items())
    return f"**Here:** {hidden}. Found: {parts}" + (f" on {found.joint}" if found.joint else "") + "."


def _quantity(parameter: Parameter) -> str:
    spread = f" ± {parameter.std:.1g}" if np.isfinite(parameter.std) else ""
    return f"{parameter.value:.3g}{spread}" + (f" {parameter.unit}" if parameter.unit != "1" else "")


def section(name: str, computed: str) -> str:
    """Return an effect's part of the page: the words of its class, and what was computed."""
    first, *told, settled = words(name)
    picture = f"![The residual before and after {name} came in](figures/effects/{name}.png){{ width=540 loading=lazy }}"
    return "\n\n".join([f"## {name}", first, picture, *told, equation(name), look_for(_only(name)), computed, settled])


def computed_in(page: str) -> dict[str, str]:
    """Return what a page says of each effect that was computed."""
    found = re.findall(r"^## (\w+)$.*?^(\*\*Here:.*?)\n\n\*\*Settled by", page, re.DOTALL | re.MULTILINE)
    return dict(found)


def page(computed: Mapping[str, str]) -> str:
    """Return the whole page."""
    made = (section(name, computed[name]) for name in names() if name in computed)
    return "\n\n".join([HEAD.strip(), *made]) + "\n"


def main(wanted: Sequence[str]) -> None:
    """Make the pictures and sections of what is wanted; the words of all others are renewed."""
    computed = computed_in(PAGE.read_text(encoding="utf-8")) if PAGE.is_file() else {}
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in () if wanted == ["--words"] else wanted or names():
        robot, runs, hidden = recordings(name)
        diagnosis = diagnose(robot, runs)
        print(name, diagnosis.verdict, *(item.label for item in diagnosis.effects), flush=True)
        effect, told = figure(diagnosis, name)
        draw(PICTURES / f"{name}.png", told)
        computed[name] = computed_of(name, robot, runs, hidden, effect)
        PAGE.write_text(page(computed), encoding="utf-8")
    PAGE.write_text(page(computed), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
