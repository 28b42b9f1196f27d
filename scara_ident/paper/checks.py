"""What of the paper reproduces."""

from __future__ import annotations

from scara_ident.paper import motion_checks, parameter_checks, table_checks
from scara_ident.paper.report import PaperReport


def check_paper() -> PaperReport:
    """Compute what the paper prints, and hold its tables against each other and against mechanics.

    Returns
    -------
    PaperReport
        Sections: Table 1 and limits along eq. (7); torque rms and prediction errors that Table 5 implies; the
        averages, normalisation and order of errors in Tables 2 to 4; what the text says of them; signs and
        bounds that no arm can break in Table 5.

    Notes
    -----
    Every mark is computed from the printed figures. Where a tolerance comes from rounding, it is the worst case
    of the printed digits.
    """
    return PaperReport(
        checks=(
            *motion_checks.table1(),
            *motion_checks.limits(),
            *motion_checks.torque_rms(),
            *motion_checks.prediction_errors(),
            *table_checks.averages(),
            *table_checks.normalisation(),
            *table_checks.own_errors(),
            *table_checks.noise(),
            *table_checks.worse_than_no_model(),
            *table_checks.statements(),
            *parameter_checks.inertia(),
            *parameter_checks.friction_signs(),
        )
    )
