"""Checks of Tables 2 to 4 against themselves, each other and what the text says of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scara_ident.arrays import Array
from scara_ident.paper.report import JOINTS, Check, Subject, equality, inequality
from scara_ident.paper.tables import TABLE_1, TABLE_2, TABLE_3, TABLE_4, TORQUE_RMS, TRAJECTORIES, ErrorTable

HALF_DIGIT = 0.0005
"""Errors and averages are printed with three decimals."""
ROUNDING = 2.0 * HALF_DIGIT
"""Worst case of a printed figure against another, or against an average of printed figures."""
_FLOAT = 1e-12  # a tie in decimals must not be decided by binary rounding


def _averaged(cells: Array, axis: int, *, with_own: bool) -> Array:
    keep = np.ones_like(cells, dtype=bool) if with_own else ~np.eye(len(cells), dtype=bool)
    return np.asarray(np.mean(cells, axis=axis, where=keep))


def _printed_averages(table: ErrorTable, joint: int) -> tuple[tuple[Array, int], ...]:
    return ((np.array(table.row_average[joint]), 1), (np.array(table.column_average[joint]), 0))


def _matching(table: ErrorTable, *, with_own: bool) -> int:
    count = 0
    for joint in range(2):
        cells = np.array(table.errors[joint])
        for printed, axis in _printed_averages(table, joint):
            computed = _averaged(cells, axis, with_own=with_own)
            count += int(np.sum(np.abs(computed - printed) <= ROUNDING + _FLOAT))
    return count


def averages() -> Iterator[Check]:
    """Check the printed averages, under whichever convention reproduces more of them.

    The paper does not say whether a trajectory's error with its own parameters is averaged too.
    """
    for table in (TABLE_2, TABLE_3, TABLE_4):
        section = f"Averages of {table.name}"
        inside, outside = (_matching(table, with_own=choice) for choice in (True, False))
        total = 2 * 2 * len(TRAJECTORIES)
        with_own = inside >= outside
        convention = "diagonal included" if with_own else "diagonal left out"
        tied = "" if inside != outside else "; both conventions reproduce as many"
        words = f"the other convention reproduces {min(inside, outside)} of {total}{tied}"
        subject = Subject(section, f"averages reproduced, {convention}")
        yield equality(subject, float(total), float(max(inside, outside)), 0.0, words)
        for joint, name in enumerate(JOINTS):
            cells = np.array(table.errors[joint])
            for printed, axis in _printed_averages(table, joint):
                computed = _averaged(cells, axis, with_own=with_own)
                kind = "row average" if axis == 1 else "column average"
                for k, trajectory in enumerate(TRAJECTORIES):
                    subject = Subject(section, kind, trajectory, name, table.unit)
                    yield _average(subject, float(printed[k]), float(computed[k]))
            overall = float(np.mean(_averaged(cells, 1, with_own=with_own)))
            subject = Subject(section, "average of all", joint=name, unit=table.unit)
            yield _average(subject, table.average[joint], overall)


def _average(subject: Subject, printed: float, computed: float) -> Check:
    words = "tolerance: rounding of the cells and of the average"
    return equality(subject, printed, computed, (ROUNDING + _FLOAT) / printed, words)


def normalisation() -> Iterator[Check]:
    """Check that Table 3 is Table 2 over the error of each trajectory with its own parameters.

    For every row the cell that is farthest off in terms of what rounding allows.
    """
    section = "Table 3 from Table 2"
    for row, trajectory in enumerate(TRAJECTORIES):
        for joint, name in enumerate(JOINTS):
            errors = np.array(TABLE_2.errors[joint][row])
            printed = np.array(TABLE_3.errors[joint][row])
            own = errors[row]
            ratio = errors / own
            least = (errors - HALF_DIGIT) / (own + HALF_DIGIT)
            most = (errors + HALF_DIGIT) / (own - HALF_DIGIT)
            allowed = np.where(printed >= ratio, most - ratio, ratio - least) + HALF_DIGIT
            others = [k for k in range(len(TRAJECTORIES)) if k != row]
            worst = max(others, key=lambda k: float(abs(ratio[k] - printed[k]) / allowed[k]))
            yield equality(
                Subject(section, f"worst cell, parameters of {TRAJECTORIES[worst]}", trajectory, name),
                float(printed[worst]),
                float(ratio[worst]),
                float((allowed[worst] + _FLOAT) / printed[worst]),
                "tolerance: rounding of both cells of Table 2 and of Table 3",
            )


def own_errors() -> Iterator[Check]:
    """Check the errors of trajectories with their own parameters.

    They are the smallest of their rows, and no smaller in the model with fewer parameters.
    """
    section = "Own errors"
    for table in (TABLE_2, TABLE_4):
        for row, trajectory in enumerate(TRAJECTORIES):
            for joint, name in enumerate(JOINTS):
                errors = table.errors[joint][row]
                nearest = min((k for k in range(len(errors)) if k != row), key=lambda k: errors[k])
                subject = Subject(section, f"{table.name} own error, least of its row", trajectory, name, table.unit)
                words = f"smallest other: parameters of {TRAJECTORIES[nearest]}"
                yield _at_most(subject, errors[row], errors[nearest], words)
    for row, trajectory in enumerate(TRAJECTORIES):
        complete, reduced = (
            float(np.hypot(table.errors[0][row][row], table.errors[1][row][row])) for table in (TABLE_2, TABLE_4)
        )
        subject = Subject(section, "own error, reduced against complete model", trajectory, "both", "N m")
        holds = reduced >= complete - np.sqrt(2.0) * ROUNDING - _FLOAT
        yield inequality(subject, "printed >= computed", holds, reduced, complete, "fewer parameters cannot fit better")


def _at_most(subject: Subject, printed: float, bound: float, comment: str) -> Check:
    holds = printed <= bound + ROUNDING + _FLOAT
    return inequality(subject, "printed <= computed", holds, printed, bound, comment)


def noise() -> Iterator[Check]:
    """Hold the complete model's own errors against the repeatability of the torque, sigma of Table 1.

    More than sigma means that the model lacks something that repeats.
    """
    for row, trajectory in enumerate(TRAJECTORIES):
        for joint, name in enumerate(JOINTS):
            own, sigma = TABLE_2.errors[joint][row][row], TABLE_1.sigma[joint][row]
            subject = Subject("Own errors and noise", "Table 2 own error, at most sigma", trajectory, name, "N m")
            yield _at_most(subject, own, sigma, f"{own / sigma:.2f} times the repeatability")


def worse_than_no_model() -> Iterator[Check]:
    """Find predictions with an error above the torque itself, which predicting no torque at all would have."""
    for table in (TABLE_2, TABLE_4):
        for row, trajectory in enumerate(TRAJECTORIES):
            for joint, name in enumerate(JOINTS):
                rms = TORQUE_RMS[joint][row]
                errors = table.errors[joint][row]
                bad = [TRAJECTORIES[k] for k, error in enumerate(errors) if error > rms]
                quantity = f"{table.name} largest error, at most the torque"
                subject = Subject("Errors and torque", quantity, trajectory, name, table.unit)
                words = f"worse than no model: parameters of {', '.join(bad)}" if bad else ""
                yield inequality(subject, "printed <= computed", max(errors) <= rms, max(errors), rms, words)


def statements() -> Iterator[Check]:
    """Check what the text says of the tables."""
    section = "Statements of the text"
    order = np.argsort(TABLE_1.log_det)
    for joint, name in enumerate(JOINTS):
        along = np.array(TABLE_2.column_average[joint])[order]
        wrong = int(np.sum(np.diff(along) >= 0.0))
        subject = Subject(section, "average error falls as J_d grows: steps that rise", joint=name)
        words = " > ".join(TRAJECTORIES[k] for k in order)
        yield inequality(subject, "computed = 0", wrong == 0, None, wrong, words)
    for joint, name in enumerate(JOINTS):
        easiest = int(np.argmin(TABLE_3.row_average[joint]))
        hardest = int(np.argmax(TABLE_3.row_average[joint]))
        for kind, found, expected in (("easiest", easiest, "L2"), ("most difficult", hardest, "OJD")):
            yield inequality(
                Subject(section, f"{expected} is the {kind} to be predicted", TRAJECTORIES[found], name),
                "equal",
                TRAJECTORIES[found] == expected,
                TABLE_3.row_average[joint][TRAJECTORIES.index(expected)],
                TABLE_3.row_average[joint][found],
                "row average of Table 3",
            )
    for joint, name in enumerate(JOINTS):
        for column, trajectory in enumerate(TRAJECTORIES):
            complete, reduced = (_mean_of_others(table, joint, column) for table in (TABLE_2, TABLE_4))
            quantity = "error on the other trajectories, reduced over complete model"
            holds = reduced <= complete + ROUNDING + _FLOAT
            words = f"means of four errors: {reduced:.4f} and {complete:.4f} N m"
            subject = Subject(section, quantity, trajectory, name)
            yield inequality(subject, "computed <= 1", holds, None, reduced / complete, words)


def _mean_of_others(table: ErrorTable, joint: int, column: int) -> float:
    return float(_averaged(np.array(table.errors[joint]), 0, with_own=False)[column])
