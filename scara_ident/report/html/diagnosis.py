"""The report of a diagnosis: from the residual to the effect to the gain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.diagnosis.held_out.gain import HeldOutGain, words_of
from scara_ident.diagnosis.testing.lack_of_fit import LackOfFit
from scara_ident.inquiry.next_steps import next_steps
from scara_ident.manners import several
from scara_ident.report.diagnosis import diagnosis_dict, intervals
from scara_ident.report.doubts import parted
from scara_ident.report.html.blocks import (
    Block,
    Cell,
    Gain,
    Gains,
    Heading,
    Listing,
    Paragraph,
    Table,
    Tag,
    chance,
    name,
    number,
    superscripts,
)
from scara_ident.report.html.chapters import Chapter, chapters
from scara_ident.report.html.evidence import (
    candidate_blocks,
    events_blocks,
    evidence_blocks,
    gain_blocks,
    tentative_blocks,
    variation_blocks,
)
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.parameters import digits, unsure
from scara_ident.report.html.remainder import remainder_group
from scara_ident.report.html.residual import residual_blocks
from scara_ident.report.html.section import NamedSection, Section, notes_section
from scara_ident.report.html.story import chapter_group, moment_group
from scara_ident.report.html.torque import torque_group
from scara_ident.report.traces import FittedContext, Trace, traces
from scara_ident.report.use import WORDS
from scara_ident.threads import one_blas_thread

PICTURED = (("validation", "held-out"), ("training", "training"))
# Share of the remainder that a dependence explains at least, to be shown: below it reads 0.0 %.
MIN_EXPLAINED = 5e-4


@dataclass(frozen=True, eq=False)
class DiagnosisContext(FittedContext):
    """What the sections of a diagnosis draw from."""

    diagnosis: Diagnosis
    make_worth: Callable[[], Mapping[str, Any] | None] = lambda: None

    @cached_property
    def worth(self) -> Mapping[str, Any] | None:
        """What the effects found cost, waited for when it is first asked for."""
        return self.make_worth()

    @one_blas_thread()
    def make_ready(self) -> None:
        """Make what pictures and page are of, before both are drawn side by side."""
        _ = self.chapters, self.groups

    @cached_property
    def content(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        # What to do next takes long: what the effects cost is waited for after it.
        _ = next_steps(self.diagnosis)
        return diagnosis_dict(self.diagnosis, self.worth)

    @cached_property
    def groups(self) -> dict[str, list[tuple[Trace, ...]]]:
        """Traces by recording, as corrected."""
        found, value = self.diagnosis, self.diagnosis.after.value
        return {"held out": traces(found.validation_after, value), "training": traces(found.training_after, value)}

    @cached_property
    def chapters(self) -> list[tuple[FoundEffect, Chapter]]:
        """Every effect found with the residuals before and after it."""
        return chapters(self.diagnosis)

    def unit(self, joint: str) -> str:
        """Return the unit of a joint's torque."""
        return self.diagnosis.robot.torque_unit(self.diagnosis.robot.joints.index(joint))


def _story(context: DiagnosisContext) -> list[Block]:
    """Every effect found, with the residual before and after it, and the parameters that it had bent."""
    diagnosis = context.diagnosis
    if not diagnosis.effects:
        tried = diagnosis.search.tried
        return [
            Paragraph(
                f"{tried} candidates were tried and none was added to the model; the reasons are under Candidates."
            )
        ]
    blocks: list[Block] = []
    for effect, chapter in context.chapters:
        blocks += [Heading(f"{chapter.number}. {effect.title}"), *_effect_words(effect, context)]
        blocks += [chapter_group(diagnosis.robot, chapter), moment_group(diagnosis.robot, chapter)]
    columns = {column.name: column for column in diagnosis.before.model.columns}
    rows: list[list[Cell | str]] = [
        [
            name(moved["name"]),
            number(moved["urdf"], 4),
            number(moved["before"], 4),
            number(moved["after"], 4),
            f"{moved['in_std']:+.3g}",
            superscripts(columns[moved["name"]].unit),
            Cell(superscripts(columns[moved["name"]].meaning), "words"),
        ]
        for moved in context.content["moved"]
    ]
    if rows:
        blocks += [
            Heading("Parameters that the missing effects had biased"),
            Paragraph("These parameters changed by more than three standard deviations when the effects were added."),
            Table(("name", "URDF", "before", "after", "change / std", "unit", "meaning"), rows, (1, 2, 3, 4)),
        ]
    return blocks


def _said(effect: FoundEffect) -> str:
    """An effect in a sentence; the name of a joint stays as it is."""
    words = effect.effect.replace("_", " ")
    return words if effect.joint is None else f"{words} on {effect.joint}"


def _held_out(gain: HeldOutGain, context: DiagnosisContext) -> str:
    criteria, words = context.diagnosis.search.step.criteria, words_of(gain, context.unit(gain.joint))
    if gain.borne_out(criteria):
        return f"On the held-out recordings, which no choice has used, it removes {gain.share:.0%} of the squared residual; {words}."
    return f"It is not {'supported' if gain.against(criteria) else 'confirmed'} by the held-out recordings: {words}."


def _effect_words(effect: FoundEffect, context: DiagnosisContext) -> list[Block]:
    helps, voting = effect.votes
    gains = ", ".join(
        f"{joint} {number(effect.before[joint])} to {number(effect.after[joint])} {context.unit(joint)}"
        for joint in context.diagnosis.robot.joints
        # Of most joints an effect changes nothing that could be read.
        if joint == effect.joint
        or (joint in effect.before and number(effect.before[joint]) != number(effect.after[joint]))
    )
    p_value = chance(effect.p_value)
    words = (
        f"{effect.description[:1].upper()}{effect.description[1:]}. In cross-validation it removes {effect.gain:.0%} "
        f"of the squared residual and helps in {helps} of {voting} trajectories that excite it; the probability that "
        f"it is chance is p {'' if p_value.startswith('<') else '= '}{p_value}. Rms on the training recordings: "
        f"{gains}."
    )
    if effect.held_out is not None:
        words += f" {_held_out(effect.held_out, context)}"
    rows: list[list[Cell | str]] = [
        [
            name(label),
            digits(parameter.value, parameter.std),
            unsure(parameter),
            "" if parameter.unit == "1" else superscripts(parameter.unit),
        ]
        for label, parameter in effect.parameters.items()
    ]
    blocks: list[Block] = [Paragraph(words), Table(("parameter", "value", "std", "unit"), rows, (1, 2))]
    doubted = effect.held_out is not None and effect.held_out.against(context.diagnosis.search.step.criteria)
    if not effect.size_determined and not doubted:
        blocks.append(Paragraph("It is significant, but its size is not determined."))
    if len(found := intervals(effect, context.diagnosis)) > 1:
        blocks += [Paragraph("It acts in these intervals:"), _interval_table(found)]
    if effect.confounded_with:
        others = ", ".join(
            f"{name} (would remove {confounder.gain:.0%} in its place)"
            for name, confounder in zip(
                effect.confounder_names(context.diagnosis.search.scene), effect.confounded_with, strict=True
            )
        )
        blocks.append(Paragraph(f"These recordings cannot distinguish it from: {others}."))
    return blocks


def _interval_table(found: Sequence[Mapping[str, Any]]) -> Table:
    rows: list[list[Cell | str]] = [
        [
            name(item["recording"]),
            *(
                # Without a standard deviation it is where the recording itself begins or ends.
                f"{item[end]:.2f} ± {item[f'{end}_std']:.1g}" if item[f"{end}_std"] else f"its {its}"
                for end, its in (("from", "begin"), ("to", "end"))
            ),
        ]
        for item in found
    ]
    return Table(("recording", "from [s]", "to [s]"), rows, (1, 2))


def _variation(context: DiagnosisContext) -> Sequence[Block]:
    """How runs differ."""
    found = context.diagnosis
    runs = [item.name for item in found.training_after.data.recordings]
    return variation_blocks(found.robot, found.after.variation, runs)


def _next(context: DiagnosisContext) -> list[Block]:
    """What to record next."""
    steps, aliases = next_steps(context.diagnosis), len(context.diagnosis.aliases)
    # The last ones are what the model absorbs on any data, which has a table of its own.
    found = [item.sentence() for item in steps[: len(steps) - aliases]]
    blocks: list[Block] = [
        Listing(tuple(found))
        if found
        else Paragraph("No other experiment is needed for what these recordings can show.")
    ]
    absorbed = f"{several(aliases, 'effect')} more would need a measurement of another kind: see What cannot be known."
    return [*blocks, Paragraph(absorbed)] if aliases else blocks


def _left(context: DiagnosisContext) -> list[Block]:
    """What is left: what repeats of it, what it depends on, and its figures."""
    diagnosis = context.diagnosis
    blocks = [*_repeating(context), *_depending(context)]
    if diagnosis.unexplained is not None:
        group = remainder_group(diagnosis.robot, diagnosis.unexplained, context.sets["training"])
        blocks += [] if group is None else [Heading("What no effect explains"), group]
    return [*blocks, *residual_blocks(diagnosis.robot, context.sets, diagnosis.search.bands)]


def _repeating(context: DiagnosisContext) -> list[Block]:
    earlier = {fit.joint: fit for fit in context.diagnosis.fit_before}
    rows: list[list[Cell | str]] = []
    for fit in context.diagnosis.fit_after:
        before = number(earlier[fit.joint].missing if fit.joint in earlier else None)
        values = (before, number(fit.missing), number(fit.noise), context.unit(fit.joint), chance(fit.p_value))
        rows.append([name(fit.joint), *values, Cell(tag=_repeats(fit))])
    head = ("joint", "repeats, before", "repeats, after", "does not repeat", "unit", "p", "")
    words = "From repetitions: the part of the residual that repeats from run to run, which a model could explain, and the part that does not (rms)."
    return [Paragraph(words), Table(head, rows, (1, 2, 3, 5))] if rows else []


def _repeats(fit: LackOfFit) -> Tag:
    if fit.p_value > 0.01:
        return Tag("nothing repeats", "good")
    return Tag("repeats, below the noise") if fit.missing <= fit.noise else Tag("repeats, above the noise", "bad")


def _depending(context: DiagnosisContext) -> list[Block]:
    rows: list[list[Cell | str]] = [
        [
            name(item.joint),
            " and ".join(item.signals),
            Cell(f"{item.explained:.1%}", "num", max(0.0, min(1.0, item.explained))),
            f"{number(item.rms)} {context.unit(item.joint)}",
        ]
        for item in [item for item in context.diagnosis.dependences if item.explained > MIN_EXPLAINED][:6]
    ]
    if rows:
        words = "What the remainder depends on: the share of its mean square that its means over signals explain, in cross-validation over trajectories."
        return [Paragraph(words), Table(("joint", "signals", "explained", "rms"), rows, (2, 3))]
    words = "In cross-validation over trajectories the remainder depends on no signal and on no pair of signals."
    return [Paragraph(words)] if context.diagnosis.dependences else []


def _torque(context: DiagnosisContext) -> list[Block]:
    """Torque over time, as the model with the effects predicts it."""
    group = torque_group(context.diagnosis.robot, context.parts, context.diagnosis.search.bands)
    return [Paragraph("Predicted by the model with the effects found."), group]


def _unknowable(context: DiagnosisContext) -> list[Block]:
    """Effects that these recordings, or any, cannot tell from another."""
    effects = context.diagnosis.effects
    groups = [
        " | ".join((effect.title, *dict.fromkeys(effect.confounder_names(context.diagnosis.search.scene))))
        for effect in effects
        if effect.confounded_with
    ]
    none = Paragraph("None among the effects found." if effects else "No effect was found.")
    blocks: list[Block] = [
        Heading("Groups that these recordings cannot distinguish"),
        Listing(tuple(groups)) if groups else none,
    ]
    rows: list[list[Cell | str]] = [
        [
            name(row["effect"]),
            Cell(", ".join(row["joints"]) or "-", "words"),
            Cell(", ".join(row["absorbed_by"]) or "no torque at all", "words"),
            Cell(row["opened_by"], "words"),
        ]
        for row in context.content["not_identifiable"]
    ]
    if rows:
        blocks += [
            Heading("Effects that the model absorbs on any data"),
            Paragraph("Neither found nor excluded: on any motion these parameters absorb them."),
            Table(("effect", "joints", "absorbed by", "what would show it"), rows),
        ]
    return blocks


def _worth(context: DiagnosisContext) -> list[Block]:
    """What the effects cost in tracking, and what feeding them forward wins."""
    found = context.worth
    if found is None:
        return []
    said = [Paragraph(" ".join(found["summary"]))]
    if found["tracking"] is None:
        return [*said]
    rows = [(WORDS[key], errors) for key, errors in found["tracking"].items()]
    for item in found["effects"]:
        title = item["effect"] if item["joint"] is None else f"{item['effect']} on {item['joint']}"
        rows.append((f"PID alone, arm without {title}", item["pid_without_it"]))
        if item["fed_without_it"] is not None:
            rows.append((f"all in the feed-forward except {title}", item["fed_without_it"]))
    joints = context.diagnosis.robot.joints
    head = ["rms tracking error", *(f"{joint} [{superscripts(found['units'][joint])}]" for joint in joints)]
    cells: list[list[Cell | str]] = [
        [name(words), *(number(errors[joint]) for joint in joints)] for words, errors in rows
    ]
    words = (
        f"A virtual arm with the effects follows a motion of {found['trajectory']['duration']:.3g} s that was not "
        "recorded. Its parameters are drawn at random from the identified values and their standard deviations."
    )
    return [*said, Paragraph(words), Table(head, cells, range(1, len(head)))]


SECTIONS: tuple[Section, ...] = (
    NamedSection("gain", "Before and after", lambda context: gain_blocks(context.content, context.diagnosis.robot)),
    NamedSection("story", "The story", _story),
    NamedSection("tentative", "Worth a look", lambda context: tentative_blocks(context.content)),
    NamedSection("next", "What to do next", _next),
    NamedSection("left", "What is left", _left),
    NamedSection("evidence", "Is it noise?", lambda context: evidence_blocks(context.content)),
    NamedSection("events", "Events", lambda context: events_blocks(context.diagnosis.robot, context.diagnosis.events)),
    NamedSection("variation", "How runs differ", _variation),
    NamedSection("torque-section", "Torque", _torque),
    NamedSection("candidates", "Candidates", lambda context: candidate_blocks(context.content)),
    NamedSection("limits", "What cannot be known", _unknowable),
    NamedSection("worth", "What the effects cost", _worth),
    notes_section(lambda context: context.diagnosis.notes),
)


def diagnosis_report(path: Path, context: DiagnosisContext) -> None:
    """Write the report of a diagnosis as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    diagnosis, content = context.diagnosis, context.content
    # Many small matrices: threads of BLAS would only wait for each other.
    with one_blas_thread():
        found = parts("diagnosis", SECTIONS, context)
    subtitle = (
        f"{diagnosis.before.model.name} model; {several(len(diagnosis.training_after.data.recordings), 'recording')}, {len(diagnosis.validation_after.data.recordings)} held out; "
        f"{diagnosis.search.tried} candidates tried"
    )
    first, others = parted(content)
    verdict = (*first, *_verdict(diagnosis, others))
    warn = bool(first) or diagnosis.verdict in ("unexplained", "undecided")
    title = f"Diagnosis of {diagnosis.robot.name}"
    Page(title, subtitle, verdict, found, warn, _picture(context)).write(path)


def _picture(context: DiagnosisContext) -> Gains | None:
    """Before and after at a glance, on held-out recordings where there are any; nothing where nothing was found."""
    if not context.diagnosis.effects:
        return None
    kind, words = next(each for each in PICTURED if context.content[each[0]]["before"])
    before, after = (context.content[kind][when] for when in ("before", "after"))
    each = [Gain(joint, before[joint], after[joint], context.unit(joint)) for joint in before if before[joint]]
    title = f"Rms residual on {words} recordings, without and with the effects found; each joint on its own scale"
    return Gains(title, tuple(each))


def _verdict(diagnosis: Diagnosis, summary: Sequence[str]) -> tuple[str, ...]:
    """The verdict in a sentence, then what it rests on."""
    criteria = diagnosis.search.step.criteria
    sure = [item for item in diagnosis.effects if item.held_out is None or not item.held_out.against(criteria)]
    found = " and ".join(_said(effect) for effect in sure)
    if diagnosis.verdict in ("complete", "undecided"):
        # The first of the sentences says so already.
        return tuple(summary)
    if diagnosis.verdict == "explained":
        return (f"Explained: the model lacked {found}; what is left is noise, or smaller than the noise.", *summary)
    lacks = f"the model lacked {found}, and something" if found else "something"
    where = f" on {diagnosis.unexplained.joint}" if diagnosis.unexplained else ""
    return (f"Not all explained: {lacks}{where} is left that no known effect explains.", *summary)
