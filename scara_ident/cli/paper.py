"""``scara-ident paper``."""

from __future__ import annotations

from scara_ident.cli.console import OutputOption, output_console, table

# Printed line by line; of the others only the count and what differs.
_IN_FULL = ("Table 1", "Limits", "Torque rms from Table 5")


def paper(output: OutputOption = None) -> None:
    """Set the tables of Indri et al. (2002) beside what the program computes, and mark which agree."""
    from scara_ident.indri2002 import check_paper
    from scara_ident.report.files import check_output, write_json

    check_output(output)
    report = check_paper()
    console = output_console()
    for section in report.sections:
        checks = report.section(section)
        agreeing = sum(check.agrees is True for check in checks)
        judged = sum(check.agrees is not None for check in checks)
        shown = checks if section in _IN_FULL else [check for check in checks if check.agrees is False]
        rows = table(
            f"{section}: {agreeing} of {judged} agree",
            *("quantity", "trajectory", "joint", "printed", "computed", "", "comment"),
            right=("printed", "computed"),
        )
        for check in shown:
            mark = {True: "agrees", False: "differs", None: ""}[check.agrees]
            rows.add_row(
                check.quantity,
                check.trajectory or "",
                str(check.joint or ""),
                _number(check.printed),
                _number(check.computed),
                mark,
                check.comment or "",
            )
        console.print(rows)
    if output is not None:
        write_json(output / "paper.json", report.to_dict())
        console.print(f"written: {output / 'paper.json'}", markup=False, soft_wrap=True)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
