"""The report of an identification."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scara_ident.identification import Identification, undetermined
from scara_ident.recording import Recording
from scara_ident.report.html.friction import friction_group
from scara_ident.report.html.page import Block, Page, Section, heading, listing, paragraph
from scara_ident.report.html.parameters import (
    cheap_history,
    convergence_group,
    correlation_group,
    parameter_table,
    strongest_pairs,
)
from scara_ident.report.html.residual import residual_blocks
from scara_ident.report.html.torque import error_table, torque_group
from scara_ident.report.html.traces import traces
from scara_ident.report.identification import sentences
from scara_ident.threads import one_blas_thread


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
    identification_page(identification, recordings, validation).write(path)


def identification_page(
    identification: Identification, recordings: Sequence[Recording], validation: Sequence[Recording] = ()
) -> Page:
    """Assemble the report of an identification."""
    estimate = identification.estimate
    robot = identification.model.robot
    bands = identification.bands
    with one_blas_thread():
        parts = {
            recording.name: traces(estimate.model, estimate.value, recording, bands)
            for recording in (*validation, *recordings)
        }
    held_out = {recording.name for recording in validation}
    fitted = [part for recording in recordings for part in parts[recording.name]]
    kept = [part for recording in validation for part in parts[recording.name]]
    band_words = ", ".join(
        f"{joint} {'unfiltered' if band is None else f'{band:.3g} Hz'}"
        for joint, band in zip(robot.joints, bands, strict=True)
    )
    sections = [
        Section(
            "prediction",
            "Prediction",
            (
                paragraph(f"Rms residual within the band ({band_words}), and as a share of the rms torque. A click on a number shows it below."),
                error_table(robot, identification.training_errors(), identification.validation_errors(), tuple(parts)),
                torque_group(robot, parts, bands, held_out),
            ),
        ),
        Section("parameters", "Parameters", _parameter_blocks(identification)),
        Section("residual", "Residual", residual_blocks(robot, {"fitted": fitted, "held out": kept}, bands)),
    ]
    friction = friction_group(estimate, fitted)
    if friction is not None:
        words = "Where the strip below is dark the data hold many samples; beyond it the curve is an extrapolation. The dots are the measured torque less everything but friction, over velocity, ± 2 standard errors."
        sections.insert(2, Section("friction", "Friction", (paragraph(words), friction)))
    history = identification.history or cheap_history(estimate, identification.training)
    words = "The recursive estimate as samples come in, with two standard deviations for white residuals; dashed the final value, dotted where a recording ends."
    sections.append(Section("convergence", "Convergence", (paragraph(words), convergence_group(estimate, history, identification.training))))
    if identification.notes:
        sections.append(Section("notes", "Notes on the data", (listing(identification.notes),)))
    samples = sum(item.samples for item in identification.training)
    subtitle = (
        f"{identification.model.name} model, {len(estimate.model.columns)} parameters, {estimate.method}; "
        f"{len(recordings)} recordings, {samples} samples fitted, {len(validation)} recordings held out; "
        f"J_d {identification.log_det:.2f}, J_k {identification.condition:.3g}"
    )
    return Page(
        f"Identification of {robot.name}", subtitle, sentences(identification), sections, bool(undetermined(identification))
    )


def _parameter_blocks(identification: Identification) -> list[Block]:
    estimate = identification.estimate
    blocks: list[Block] = [
        paragraph(f"Standard deviations from {STD_WORDS.get(estimate.std_kind, estimate.std_kind)}."),
        parameter_table(estimate),
        heading("Correlation"),
    ]
    pairs = strongest_pairs(estimate)
    if pairs:
        blocks.append(paragraph(f"Strongest: {', '.join(pairs)}."))
    return [*blocks, correlation_group(estimate)]


__all__ = ["identification_page", "identification_report"]
