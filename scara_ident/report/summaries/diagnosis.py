"""Summary, columns and figure of a diagnosis: the verdict, the effects found, errors before and after, and what else was tried."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.manners import several
from scara_ident.report.diagnosis import beyond_chance, diagnosis_dict
from scara_ident.report.doubts import parted
from scara_ident.report.left_out import left_out_words
from scara_ident.report.summaries.words import in_units, table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

# Candidates shown where not all are wanted.
MAX_CANDIDATES = 8
# The content of ``diagnosis.json``.
content = diagnosis_dict


def summary(diagnosis: Diagnosis) -> str:
    """Return the verdict, the result in sentences, errors before and after, and what `Diagnosis.predict` leaves out."""
    held = diagnosis_dict(diagnosis)
    notes = [f"note: {note}" for note in diagnosis.notes]
    heading = f"{diagnosis.robot.name}: {diagnosis.verdict}"
    left = [f"predict leaves out {name}." for name in diagnosis.not_predicted]
    first, others = parted(held)
    return text_of(*first, *notes, heading, *others, *tables(held), *left)


def columns(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a row for each parameter of each effect found, with the ends of its interval where it has one."""
    rows = [
        (
            found.effect,
            found.joint,
            name,
            each.value,
            each.std,
            each.unit,
            found.p_value,
            found.gain,
            *(each.interval or (nan, nan)),
        )
        for found in diagnosis.effects
        for name, each in found.parameters.items()
    ]
    names = ("effect", "joint", "parameter", "value", "std", "unit", "p_value", "gain", "low", "high")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def figure(diagnosis: Diagnosis) -> Figure:
    """Draw the residual before and after, effect by effect; without one, the torque of the base model's fit."""
    from scara_ident.report.drawing import canvas
    from scara_ident.report.html.diagnosis import DiagnosisContext
    from scara_ident.report.pictures import effect_figures, torque_figures

    context = DiagnosisContext(diagnosis)
    title, rows = f"{diagnosis.robot.name}: {diagnosis.verdict}", []
    for _, _, own in effect_figures(context):
        rows += own
    if not rows:
        rows += torque_figures(context, diagnosis.robot, diagnosis.search.bands)[1]
    return canvas(title, rows)


def tables(held: dict[str, Any], *, all_candidates: bool = False) -> list[Table]:
    """Return errors before and after by joint, and the candidates, of the content of ``diagnosis.json``.

    Those that are no better than chance are counted, not named, unless all are wanted.
    """
    title = f"rms error within the band [{in_units(held['torque_units'])}]"
    errors = table(title, "recordings", "joint", "before", "after", right=("before", "after"))
    for kind in ("training", "validation"):
        for joint, before in held[kind]["before"].items():
            errors.add_row(kind, joint, _number(before), _number(held[kind]["after"][joint]))
        for joint, before in held[kind].get("before_own_offset", {}).items():
            after = held[kind]["after_own_offset"][joint]
            errors.add_row(f"{kind}, own offsets", joint, _number(before), _number(after))
    errors.caption, errors.caption_justify = left_out_words(held) or None, "left"
    rows = table("candidates", "candidate", "gain", "p", "why", right=("gain", "p"))
    tried = held["candidates"]
    shown = tried if all_candidates else beyond_chance(tried)[:MAX_CANDIDATES]
    for row in shown:
        rows.add_row(row["label"], f"{row['gain']:.1%}", f"{row['p_value']:.0e}", row["why"])
    others = len(tried) - len(shown)
    if others:
        rows.add_row(several(others, "other"), "", "", "not believed")
    return [errors, rows]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
