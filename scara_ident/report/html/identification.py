"""The report of an identification."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from scara_ident.diagnosis.model_selection import joint_errors
from scara_ident.estimation.consistent.estimator import ConsistentEstimate
from scara_ident.identification.identify import Identification, undetermined
from scara_ident.recording.recording import Recording
from scara_ident.report.html.friction import friction_group
from scara_ident.report.html.page import Block, Page, Section, count, heading, listing, paragraph
from scara_ident.report.html.parameters import (
    cheap_history,
    convergence_group,
    correlation_group,
    link_table,
    parameter_table,
    strongest_pairs,
)
from scara_ident.report.html.residual import residual_blocks
from scara_ident.report.html.torque import error_table, torque_group
from scara_ident.report.html.traces import traces
from scara_ident.report.identification import sentences
from scara_ident.threads import one_blas_thread

# Joints whose errors the first sentence lists; of more it gives the range.
MOST_SHARES = 3
SYMBOLS = (
    "In the meanings m is a mass, mx, my, mz (or m s) are first moments, I is an inertia about the joint's frame, Jm that of "
    "a rotor, l a length and tau 1 / reduction, numbered by link or joint."
)
STD_WORDS = {
    "block": "the scatter of blocks of time, which holds when residuals are correlated",
    "pooled block": "the scatter of few blocks of time, pooled over parameters",
}


def identification_report(
    path: Path, identification: Identification, recordings: Sequence[Recording], validation: Sequence[Recording] = ()
) -> None:
    """Write the report of an identification as one HTML file.

    Parameters
    ----------
    path : Path
    identification : Identification
    recordings, validation : sequence of Recording
        Those that were fitted and those that were held out.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    # Many small matrices: threads of BLAS would only wait for each other.
    with one_blas_thread():
        page = identification_page(identification, recordings, validation)
    page.write(path)


def identification_page(
    identification: Identification, recordings: Sequence[Recording], validation: Sequence[Recording] = ()
) -> Page:
    """Assemble the report of an identification."""
    estimate = identification.estimate
    robot = identification.model.robot
    bands = identification.bands
    kept, fitted = (
        [traces(estimate.model, estimate.value, recording, bands) for recording in group]
        for group in (validation, recordings)
    )
    parts = [
        *((f"{recording.name} (held out)", found) for recording, found in zip(validation, kept, strict=True)),
        *((f"{recording.name} (fitted)", found) for recording, found in zip(recordings, fitted, strict=True)),
    ]
    errors = [estimate.errors(item) for item in (*identification.validation, *identification.training)]
    sets = {"fitted": list(chain.from_iterable(fitted)), "held out": list(chain.from_iterable(kept))}
    band_words = ", ".join(
        f"{joint} {'unfiltered' if band is None else f'{band:.3g} Hz'}"
        for joint, band in zip(robot.joints, bands, strict=True)
    )
    sections = [
        Section(
            "prediction",
            "Prediction",
            (
                paragraph(
                    f"Rms residual within the band ({band_words}), and as a share of the rms torque: the darker, the larger. A click on a number shows it below."
                ),
                error_table(robot, [name for name, _ in parts], errors),
                torque_group(robot, parts, bands),
            ),
        ),
        Section("parameters", "Parameters", _parameter_blocks(identification)),
        Section("residual", "Residual", residual_blocks(robot, sets, bands)),
    ]
    friction = friction_group(estimate, sets["fitted"])
    if friction is not None:
        words = "Where the strip below is dark the data hold many samples; beyond it the curve is an extrapolation. The dots are the measured torque less everything but friction, over velocity, ± 2 standard errors."
        sections.insert(2, Section("friction", "Friction", (paragraph(words), friction)))
    history = identification.history or cheap_history(estimate, identification.training)
    words = "The recursive estimate as samples come in, with two standard deviations for white residuals, which are too small where residuals are correlated; dashed: the final value, dotted: where a recording ends."
    if estimate.method not in ("ols", "rls"):
        words += f" The recursion is least squares; the method {estimate.method} ends elsewhere."
    sections.append(
        Section(
            "convergence",
            "Convergence",
            (paragraph(words), convergence_group(estimate, history, identification.training)),
        )
    )
    if identification.notes:
        sections.append(Section("notes", "Notes on the data", (listing(identification.notes),)))
    samples = sum(item.samples for item in identification.training)
    subtitle = (
        f"{identification.model.name} model, {len(estimate.model.columns)} parameters, {estimate.method}; "
        f"{count(len(recordings), 'recording')}, {samples} samples fitted, {count(len(validation), 'recording')} held out; "
        f"J_d (information) {identification.log_det:.2f}, J_k (condition) {identification.condition:.3g}"
    )
    return Page(
        f"Identification of {robot.name}",
        subtitle,
        (_headline(identification), *sentences(identification)),
        sections,
        bool(undetermined(identification)),
    )


def _headline(identification: Identification) -> str:
    """How well the parameters predict, over all recordings held out, or else over those fitted."""
    held_out = identification.validation
    errors = joint_errors(identification.estimate.value, held_out or identification.training)
    robot = identification.model.robot
    shares = [
        (error.relative, joint) for joint, error in zip(robot.joints, errors, strict=True) if error and error.relative
    ]
    what = "Predicts held-out recordings" if held_out else "Fits its own recordings"
    if not shares:
        return f"{identification.model.name} model of {robot.name}."
    if len(shares) > MOST_SHARES:
        (least, best), (most, worst) = min(shares), max(shares)
        return f"{what} to within {least:.1%} ({best}) to {most:.1%} ({worst}) of the torque, rms."
    return f"{what} to within {' and '.join(f'{share:.1%} of the torque of {joint}' for share, joint in shares)}, rms."


def _parameter_blocks(identification: Identification) -> list[Block]:
    estimate = identification.estimate
    blocks: list[Block] = [
        paragraph(f"Standard deviations from {STD_WORDS.get(estimate.std_kind, estimate.std_kind)}. {SYMBOLS}"),
        parameter_table(estimate),
        heading("Correlation"),
    ]
    pairs = strongest_pairs(estimate)
    if pairs:
        blocks.append(paragraph(f"Strongest: {', '.join(pairs)}."))
    blocks.append(correlation_group(estimate))
    if isinstance(estimate, ConsistentEstimate):
        blocks += [
            heading("Links of an arm with these parameters"),
            paragraph(
                "Mass, centre of mass and inertia about it, in the axes of the link. Torque tells their combinations in the table above, "
                "not each number: the rest is as near to the URDF as the data allow."
            ),
            link_table(estimate),
        ]
    return blocks


__all__ = ["identification_page", "identification_report"]
