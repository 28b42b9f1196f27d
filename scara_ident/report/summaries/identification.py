"""Summary, columns and figure of an identification: parameters, errors on every recording, and sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scara_ident.identification.identify import Identification
from scara_ident.report.identification import headline_and_details, identification_dict
from scara_ident.report.summaries import estimate
from scara_ident.report.summaries.words import in_units, table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

# The content of ``identification.json``, with the estimate that `load_estimate` reads.
content = identification_dict


def summary(identification: Identification) -> str:
    """Return what questions the result, parameters, errors and bands as tables, and the result in sentences."""
    notes = [f"note: {note}" for note in identification.notes]
    first, others = headline_and_details(identification)
    return text_of(*first, *notes, *tables(identification), bands_said(identification), *others)


def columns(identification: Identification) -> dict[str, Any]:
    """Return a row for each parameter."""
    return estimate.columns(identification.estimate)


def figure(identification: Identification) -> Figure:
    """Draw measured, predicted and residual torque over time."""
    from scara_ident.report.drawing import canvas
    from scara_ident.report.html.identification import IdentificationContext
    from scara_ident.report.pictures import torque_figures

    context = IdentificationContext(identification)
    return canvas(*torque_figures(context, identification.model.robot, identification.bands))


def tables(identification: Identification) -> list[Table]:
    """Return the parameters, and the errors on the recordings that were fitted and on those that were not."""
    found = [estimate.parameter_table(identification.estimate)]
    robot = identification.model.robot
    title = f"rms error within the band [{in_units(robot.torque_units)}],"
    for kind, errors in (
        ("fitted", identification.training_errors()),
        ("held out", identification.validation_errors()),
    ):
        if not errors:
            continue
        own_offsets = any(error and error.rms_own_offset is not None for own in errors.values() for error in own)
        numbers = ("rms", "of torque", "unfiltered", *(["own offset"] if own_offsets else []))
        rows = table(f"{title} {kind}", "recording", "joint", *numbers, right=numbers)
        for name, own in errors.items():
            for joint, error in zip(robot.joints, own, strict=True):
                if error is None:
                    rows.add_row(name, joint, "-", "at rest", *["-"] * (len(numbers) - 2))
                    continue
                share = "-" if error.relative is None else f"{error.relative:.1%}"
                beside = [] if error.rms_own_offset is None else [f"{error.rms_own_offset:.3g}"]
                rows.add_row(name, joint, f"{error.rms:.3g}", share, f"{error.rms_unfiltered:.3g}", *beside)
        found.append(rows)
    return found


def bands_said(identification: Identification) -> str:
    """Say the band of every joint, and the paper's criteria."""
    bands = ", ".join(
        f"{joint} {'none' if cut is None else f'{cut:.3g} Hz'}"
        for joint, cut in zip(identification.model.robot.joints, identification.bands, strict=True)
    )
    return f"band: {bands}; J_d {identification.log_det:.2f}, J_k {identification.condition:.3g}"
