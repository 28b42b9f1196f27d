"""The report of a diagnosis: from the residual to the effect to the gain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis, FoundEffect, corrected
from scara_ident.diagnosis.lack_of_fit import LackOfFit
from scara_ident.recording.recording import Recording
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.html.candidates import candidate_blocks
from scara_ident.report.html.chapters import chapters
from scara_ident.report.html.experiments import next_experiments
from scara_ident.report.html.page import (
    Block,
    Cell,
    Page,
    Section,
    chance,
    count,
    escape,
    folded,
    heading,
    listing,
    number,
    paragraph,
    superscripts,
    table,
    tag,
    track,
)
from scara_ident.report.html.parameters import digits
from scara_ident.report.html.remainder import remainder_group
from scara_ident.report.html.residual import residual_blocks
from scara_ident.report.html.story import chapter_group, moment_group
from scara_ident.report.html.torque import torque_group
from scara_ident.report.html.traces import Trace, traces
from scara_ident.threads import one_blas_thread


def diagnosis_report(
    path: Path, diagnosis: Diagnosis, recordings: Sequence[Recording], validation: Sequence[Recording] = ()
) -> None:
    """Write the report of a diagnosis as one HTML file.

    Parameters
    ----------
    path : Path
    diagnosis : Diagnosis
    recordings, validation : sequence of Recording
        Those that every choice was made on, and those that were held out; as they were given.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    # Many small matrices: threads of BLAS would only wait for each other.
    with one_blas_thread():
        page = diagnosis_page(diagnosis, recordings, validation)
    page.write(path)


def diagnosis_page(diagnosis: Diagnosis, recordings: Sequence[Recording], validation: Sequence[Recording] = ()) -> Page:
    """Assemble the report of a diagnosis."""
    content = diagnosis_dict(diagnosis)
    robot, bands = diagnosis.robot, diagnosis.search.bands
    held_out = corrected(diagnosis.search, validation)
    story = _story_blocks(diagnosis, content, recordings)
    kept, fitted = (
        [traces(diagnosis.after.model, diagnosis.after.value, recording, bands) for recording in group]
        for group in (held_out, diagnosis.search.recordings)
    )
    parts = [
        *((f"{recording.name} (held out)", found) for recording, found in zip(validation, kept, strict=True)),
        *((f"{recording.name} (training)", found) for recording, found in zip(recordings, fitted, strict=True)),
    ]
    sets = {"training": list(chain.from_iterable(fitted)), "held out": list(chain.from_iterable(kept))}
    experiments = next_experiments(diagnosis)
    sections = [
        Section("gain", "Before and after", _gain_blocks(diagnosis, content)),
        Section("story", "The story", story),
        Section(
            "next",
            "What to do next",
            (
                listing(experiments)
                if experiments
                else paragraph("Nothing in these recordings asks for another experiment."),
            ),
        ),
        Section(
            "left",
            "What is left",
            (*_left_blocks(diagnosis), *_remainder(diagnosis, sets["training"]), *residual_blocks(robot, sets, bands)),
        ),
        Section(
            "torque-section",
            "Torque",
            (paragraph("Predicted by the model with the effects found."), torque_group(robot, parts, bands)),
        ),
        Section("candidates", "Candidates", candidate_blocks(content)),
        Section("limits", "What cannot be known", _limit_blocks(diagnosis, content)),
    ]
    if diagnosis.notes:
        sections.append(Section("notes", "Notes on the data", (listing(diagnosis.notes),)))
    subtitle = (
        f"{diagnosis.before.model.name} model; {count(len(recordings), 'recording')}, {len(validation)} held out; "
        f"{diagnosis.search.tried} candidates and scan points tried; verdict: {diagnosis.verdict}"
    )
    return Page(
        f"Diagnosis of {robot.name}",
        subtitle,
        _verdict(diagnosis, content["summary"]),
        sections,
        diagnosis.verdict == "unexplained",
    )


def _verdict(diagnosis: Diagnosis, summary: Sequence[str]) -> tuple[str, ...]:
    """The verdict in a sentence, then what it rests on."""
    found = " and ".join(_title(effect).replace("_", " ") for effect in diagnosis.effects)
    if diagnosis.verdict == "complete":
        # The first of the sentences says so already.
        return tuple(summary)
    if diagnosis.verdict == "explained":
        return (f"Explained: the model lacked {found}; what is left is noise, or smaller than it.", *summary)
    lacks = f"the model lacked {found}, and something" if found else "something"
    where = f" on {diagnosis.unexplained.joint}" if diagnosis.unexplained else ""
    return (f"Not all explained: {lacks}{where} repeats that no known effect accounts for.", *summary)


def _gain_blocks(diagnosis: Diagnosis, content: dict[str, Any]) -> list[Block]:
    robot = diagnosis.robot
    rows: list[list[Cell | str]] = []
    for kind, words in (("validation", "held out"), ("training", "training")):
        part = content[kind]
        for j, joint in enumerate(robot.joints if part["before"] else ()):
            before, after = part["before"][joint], part["after"][joint]
            floor = content["noise_floor"].get(joint)
            rows.append(
                [
                    words,
                    Cell(escape(joint), "name"),
                    number(before),
                    number(after),
                    _change(before, after),
                    _share(part["before_relative"][joint]),
                    _share(part["after_relative"][joint]),
                    number(floor),
                    robot.torque_unit(j),
                ]
            )
    head = (
        "recordings",
        "joint",
        "before",
        "after",
        "what is left",
        "before, of torque",
        "after, of torque",
        "noise floor",
        "unit",
    )
    blocks: list[Block] = [
        paragraph(
            "Rms residual within the band. Held-out recordings took no part in any choice; the noise floor is what does not repeat."
        ),
        table(head, rows, numeric=(2, 3, 5, 6, 7)),
    ]
    detail: list[list[Cell | str]] = [
        [
            Cell(escape(name), "name"),
            words,
            *(x for joint in robot.joints for x in (number(row["before"][joint]), number(row["after"][joint]))),
        ]
        for kind, words in (("validation", "held out"), ("training", "training"))
        for name, row in content["recordings"][kind].items()
    ]
    columns = [
        "recording",
        "",
        *(
            f"{joint} {when} [{robot.torque_unit(j)}]"
            for j, joint in enumerate(robot.joints)
            for when in ("before", "after")
        ),
    ]
    return [*blocks, folded("every recording", table(columns, detail, numeric=range(2, len(columns))))]


def _change(before: float | None, after: float | None) -> Cell:
    if not before or after is None:
        return Cell("")
    change = round(100.0 * (after / before - 1.0))
    return Cell(f"{track(after / before)}{f'{change:+d}' if change else '0'} %", "unit")


def _story_blocks(diagnosis: Diagnosis, content: dict[str, Any], recordings: Sequence[Recording]) -> list[Block]:
    if not diagnosis.effects:
        return [
            paragraph(
                f"{diagnosis.search.tried} candidates were tried and none was let in; their reasons stand under Candidates."
            )
        ]
    blocks: list[Block] = []
    for effect, chapter in chapters(diagnosis, recordings):
        blocks += [heading(f"{chapter.number}. {_title(effect)}"), *_effect_words(effect, diagnosis)]
        blocks += [chapter_group(diagnosis.robot, chapter), moment_group(diagnosis.robot, chapter)]
    if content["moved"]:
        columns = {column.name: column for column in diagnosis.before.model.columns}
        rows: list[list[Cell | str]] = [
            [
                Cell(escape(m["name"]), "name"),
                number(m["before"], 4),
                number(m["after"], 4),
                f"{m['in_std']:+.3g}",
                superscripts(columns[m["name"]].unit),
                Cell(escape(superscripts(columns[m["name"]].meaning)), "words"),
            ]
            for m in content["moved"]
        ]
        blocks += [
            heading("Parameters that the missing effects had bent"),
            paragraph("They had stood for what the model lacked; by over three standard deviations."),
            table(("name", "before", "after", "change / std", "unit", "meaning"), rows, numeric=(1, 2, 3)),
        ]
    return blocks


def _title(effect: FoundEffect) -> str:
    return effect.effect if effect.joint is None else f"{effect.effect} on {effect.joint}"


def _effect_words(effect: FoundEffect, diagnosis: Diagnosis) -> list[Block]:
    helps, voting = effect.votes
    robot = diagnosis.robot
    gains = ", ".join(
        f"{joint} {number(effect.before[joint])} to {number(effect.after[joint])} {robot.torque_unit(j)}"
        for j, joint in enumerate(robot.joints)
        if joint in effect.before
    )
    words = (
        f"{effect.description[:1].upper()}{effect.description[1:]}. It removes {min(1.0, effect.gain):.0%} of the squared residual on data that it was not "
        f"fitted to, helps in {helps} of {voting} trajectories that excite it, and would come about by chance with p {_equals(effect.p_value)}. "
        f"Rms on the training recordings: {gains}."
    )
    rows: list[list[Cell | str]] = [
        [
            Cell(escape(name), "name"),
            digits(parameter.value, parameter.std),
            number(parameter.std, 2) if np.isfinite(parameter.std) else "not told",
            "" if parameter.unit == "1" else superscripts(parameter.unit),
        ]
        for name, parameter in effect.parameters.items()
    ]
    blocks: list[Block] = [paragraph(words), table(("parameter", "value", "std", "unit"), rows, numeric=(1, 2))]
    if effect.confounded_with:
        others = ", ".join(
            f"{confounder.label} (would remove {confounder.gain:.0%} in its place)"
            for confounder in effect.confounded_with
        )
        blocks.append(paragraph(f"These recordings cannot tell it from: {others}."))
    return blocks


def _left_blocks(diagnosis: Diagnosis) -> list[Block]:
    blocks: list[Block] = []
    if diagnosis.fit_after:
        earlier = {fit.joint: fit for fit in diagnosis.fit_before}
        repeats: list[list[Cell | str]] = []
        for fit in diagnosis.fit_after:
            before = earlier.get(fit.joint)
            repeats.append(
                [
                    Cell(escape(fit.joint), "name"),
                    number(before.missing if before else None),
                    number(fit.missing),
                    number(fit.noise),
                    diagnosis.robot.torque_unit(diagnosis.robot.joints.index(fit.joint)),
                    chance(fit.p_value),
                    Cell(_repeats(fit)),
                ]
            )
        head = ("joint", "repeats, before", "repeats, after", "does not repeat", "unit", "p", "")
        blocks += [
            paragraph(
                "From repetitions: what of the residual repeats from run to run, which a model could explain, against what does not (rms)."
            ),
            table(head, repeats, numeric=(1, 2, 3, 5)),
        ]
    telling = [item for item in diagnosis.dependences if item.explained > 0.0][:6]
    if diagnosis.dependences and not telling:
        blocks.append(
            paragraph(
                "On no signal or pair of signals does the remainder depend in a way that holds on trajectories that it was not taken from."
            )
        )
    if telling:
        rows: list[list[Cell | str]] = [
            [
                Cell(escape(item.joint), "name"),
                " and ".join(item.signals),
                Cell(f"{item.explained:.1%}", "num", max(0.0, min(1.0, item.explained))),
                f"{number(item.rms)} {diagnosis.robot.torque_unit(diagnosis.robot.joints.index(item.joint))}",
            ]
            for item in telling
        ]
        blocks += [
            paragraph(
                "What the remainder depends on: share of its square that means over signals explain on trajectories that they were not taken from."
            ),
            table(("joint", "signals", "explained", "rms"), rows, numeric=(2, 3)),
        ]
    return blocks


def _remainder(diagnosis: Diagnosis, fitted: Sequence[Trace]) -> list[Block]:
    if diagnosis.unexplained is None:
        return []
    group = remainder_group(diagnosis.robot, diagnosis.unexplained, fitted)
    return [] if group is None else [heading("What no effect accounts for"), group]


def _repeats(fit: LackOfFit) -> str:
    if fit.p_value > 0.01:
        return tag("nothing repeats", "good")
    return tag("repeats, below the noise") if fit.missing <= fit.noise else tag("repeats, above the noise", "bad")


def _equals(p_value: float) -> str:
    words = chance(p_value)
    return words if words.startswith("<") else f"= {words}"


def _limit_blocks(diagnosis: Diagnosis, content: dict[str, Any]) -> list[Block]:
    blocks: list[Block] = [heading("Groups that these recordings cannot tell apart")]
    groups = [effect for effect in diagnosis.effects if effect.confounded_with]
    if groups:
        blocks.append(
            listing(
                f"{_title(effect)} | {' | '.join(dict.fromkeys(confounder.label for confounder in effect.confounded_with))}"
                for effect in groups
            )
        )
    else:
        blocks.append(paragraph("None among the effects found." if diagnosis.effects else "No effect was found."))
    if content["not_identifiable"]:
        rows: list[list[Cell | str]] = [
            [
                Cell(escape(row["effect"]), "name"),
                Cell(escape(", ".join(row["absorbed_by"]) or "no torque at all"), "words"),
                Cell(escape(row["opened_by"]), "words"),
            ]
            for row in content["not_identifiable"]
        ]
        blocks += [
            heading("Effects that the model absorbs on any data"),
            paragraph("Neither found nor excluded: whatever the arm does, these parameters take them up."),
            table(("effect", "absorbed by", "what would show it"), rows),
        ]
    return blocks


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"


__all__ = ["diagnosis_page", "diagnosis_report"]
