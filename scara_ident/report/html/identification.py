"""The report of an identification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.identification.identify import Identification, undetermined
from scara_ident.manners import several
from scara_ident.report.html.blocks import Block, Heading, Paragraph, estimator_words, information_words
from scara_ident.report.html.evidence import events_blocks, variation_blocks
from scara_ident.report.html.friction import friction_group
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.parameters import (
    cheap_history,
    convergence_group,
    correlation_group,
    link_table,
    parameter_table,
    strongest_pairs,
)
from scara_ident.report.html.residual import residual_blocks
from scara_ident.report.html.section import NamedSection, Section, notes_section
from scara_ident.report.html.torque import error_table, torque_group
from scara_ident.report.identification import headline_and_details
from scara_ident.report.traces import FittedContext, Trace, traces
from scara_ident.threads import one_blas_thread

# Joints whose errors the first sentence lists; of more it gives the range.
MAX_JOINTS = 3
SYMBOLS = (
    "In the column meaning: m is a mass, mx, my, mz (or m s) are first moments, I is an inertia about the joint's "
    "frame, Jm the inertia of a rotor, l a length and tau 1 / reduction, numbered by link or joint."
)
STD_WORDS = {
    "block": "the scatter of blocks of time, which is valid for correlated residuals",
    "pooled block": "the scatter of few blocks of time, pooled over parameters",
}


@dataclass(frozen=True, eq=False)
class IdentificationContext(FittedContext):
    """What the sections of an identification draw from."""

    identification: Identification

    @cached_property
    def groups(self) -> dict[str, list[tuple[Trace, ...]]]:
        """Traces by recording."""
        found, value = self.identification, self.identification.estimate.value
        return {"held out": traces(found.validation, value), "fitted": traces(found.training, value)}


def _prediction(context: IdentificationContext) -> list[Block]:
    """Errors by recording and joint, and torque over time."""
    found = context.identification
    robot, names = found.model.robot, [name for name, _ in context.parts]
    errors = [found.estimate.errors(item) for item in (*found.validation.each, *found.training.each)]
    bands = ", ".join(
        f"{joint} {'unfiltered' if band is None else f'{band:.3g} Hz'}"
        for joint, band in zip(robot.joints, found.bands, strict=True)
    )
    return [
        Paragraph(
            f"Rms residual within the band ({bands}), and as a share of the rms torque; darker is larger. A click on a number shows its recording below."
        ),
        error_table(robot, names, errors),
        torque_group(robot, context.parts, found.bands),
    ]


def _parameters(context: IdentificationContext) -> list[Block]:
    """Parameters, their correlation, and the links of an arm that has them."""
    estimate = context.identification.estimate
    pairs = strongest_pairs(estimate)
    blocks: list[Block] = [
        Paragraph(f"Standard deviations from {STD_WORDS.get(estimate.std_kind, estimate.std_kind)}. {SYMBOLS}"),
        parameter_table(estimate),
        Paragraph(information_words(context.identification.log_det, context.identification.condition)),
        Heading("Correlation"),
        *([Paragraph(f"Strongest: {', '.join(pairs)}.")] if pairs else []),
        correlation_group(estimate),
    ]
    if isinstance(estimate, ConsistentEstimate):
        words = (
            "Mass, centre of mass and inertia about it, in the axes of the link. The torque determines only the "
            "combinations in the table above; the rest is as near to the URDF as the data allow."
        )
        blocks += [Heading("Links with these parameters"), Paragraph(words), link_table(estimate)]
    return blocks


def _events(context: IdentificationContext) -> Sequence[Block]:
    """What was local in time."""
    return events_blocks(context.identification.model.robot, context.identification.events)


def _variation(context: IdentificationContext) -> Sequence[Block]:
    """How runs differ."""
    found = context.identification
    runs = [item.name for item in found.training.data.recordings]
    return variation_blocks(found.model.robot, found.estimate.variation, runs)


def _friction_curves(context: IdentificationContext) -> list[Block]:
    """Friction over velocity; nothing where the model has none."""
    group = friction_group(context.identification.estimate, context.sets["fitted"])
    words = "A dark strip below means many samples; outside the strip the curve is extrapolated. Dots: measured torque (recorded torque within the band) minus everything in the model except friction, over velocity, ± 2 standard errors."
    return [] if group is None else [Paragraph(words), group]


def _residual(context: IdentificationContext) -> list[Block]:
    """What is left, over signals, frequency, motor angle and lag."""
    return residual_blocks(context.identification.model.robot, context.sets, context.identification.bands)


def _convergence(context: IdentificationContext) -> list[Block]:
    """How the recursive estimate settled."""
    found = context.identification
    history = found.history or cheap_history(found.training)
    words = "The recursive estimate over the samples, with two standard deviations for white residuals, which are too small if residuals are correlated. Dashed: the final value; dotted: the end of a recording."
    if found.estimate.method not in ("ols", "rls"):
        words += f" The recursion is least squares; the method {found.estimate.method} has another final value."
    return [Paragraph(words), convergence_group(found.estimate, history, found.training)]


SECTIONS: tuple[Section, ...] = (
    NamedSection("prediction", "Prediction", _prediction),
    NamedSection("parameters", "Parameters", _parameters),
    NamedSection("events", "Events", _events),
    NamedSection("variation", "How runs differ", _variation),
    NamedSection("friction", "Friction", _friction_curves),
    NamedSection("residual", "Residual", _residual),
    NamedSection("convergence", "Convergence", _convergence),
    notes_section(lambda context: context.identification.notes),
)


def identification_report(path: Path, context: IdentificationContext) -> None:
    """Write the report of an identification as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    identification = context.identification
    # Many small matrices: threads of BLAS would only wait for each other.
    with one_blas_thread():
        found = parts("identification", SECTIONS, context)
    fitted, held_out = identification.training, identification.validation
    subtitle = (
        f"{identification.model.name} model, {len(identification.model.columns)} parameters, {estimator_words(identification.estimate.method)}; "
        f"{several(len(fitted.data.recordings), 'recording')}, {fitted.samples} samples fitted, {several(len(held_out.data.recordings), 'recording')} held out"
    )
    # How runs differ has a section of its own.
    variation = identification.estimate.variation
    elsewhere = {f"{said}." for said in variation.sentences(identification.model.robot)} if variation else set()
    first, others = headline_and_details(identification)
    verdict = (*first, _headline(identification), *(said for said in others if said not in elsewhere))
    title = f"Identification of {identification.model.robot.name}"
    Page(title, subtitle, verdict, found, bool(first or undetermined(identification))).write(path)


def _headline(identification: Identification) -> str:
    """How well the parameters predict, over all recordings held out, or else over those fitted."""
    held_out = bool(identification.validation.data.recordings)
    errors = identification.estimate.errors(identification.validation if held_out else identification.training)
    robot = identification.model.robot
    shares = [
        (error.relative, joint) for joint, error in zip(robot.joints, errors, strict=True) if error and error.relative
    ]
    what = "Predicts held-out recordings" if held_out else "Fits the training recordings"
    if not shares:
        return f"{identification.model.name} model of {robot.name}."
    if len(shares) > MAX_JOINTS:
        (least, best), (most, worst) = min(shares), max(shares)
        return f"{what} to within {least:.1%} ({best}) to {most:.1%} ({worst}) of the torque, rms."
    return f"{what} to within {' and '.join(f'{share:.1%} of the torque of {joint}' for share, joint in shares)}, rms."
