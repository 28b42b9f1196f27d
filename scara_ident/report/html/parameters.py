"""Parameters with intervals and meaning, their correlation, and how the estimate settled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.effects import Parameter
from scara_ident.estimation import Estimate, History, rls
from scara_ident.estimation.consistent.estimator import ConsistentEstimate, links
from scara_ident.estimation.observations import Observations
from scara_ident.model.urdf_values import urdf_values
from scara_ident.report.diagnosis_words import ends
from scara_ident.report.html.blocks import Cell, Group, Selector, Table, Tag, name, number, superscripts
from scara_ident.report.plot import Band, Drawing, Figure, Layer, Level, Line, Mark, Matrix, Panel, Plot, single
from scara_ident.threads import one_blas_thread

# Steps of a recursion that is made for the picture only.
MAX_STEPS = 48
# Recordings whose limits are marked in the pictures of the recursion.
MAX_MARKS = 12
# Figures of the recursion shown together; more are shown in pages of so many.
MAX_FIGURES = 18
# Share of a body's largest moment below which one of its products is rounding.
NO_INERTIA = 1e-9
PER_PAGE = 12
# Pairs of parameters that are named in words, at the most, and the least size of their correlation.
MAX_PAIRS, STRONG_CORRELATION = 4, 0.9


def parameter_table(estimate: Estimate) -> Table:
    """Return the parameters beside the URDF's, with 95 % intervals, relative standard deviations and meanings."""
    rows: list[list[Cell | str]] = []
    nominal = urdf_values(estimate.model)
    for k, column in enumerate(estimate.model.columns):
        value, std = float(estimate.value[k]), float(estimate.std[k])
        if estimate.undetermined[k]:
            interval, share = Cell(tag=Tag("undetermined", "bad")), Cell()
        else:
            relative = std / abs(value) if value else np.inf
            weak = relative > 0.5
            interval = Cell(f"{digits(value - 1.96 * std, std)} … {digits(value + 1.96 * std, std)}", "num")
            percent = 100.0 * relative
            words = "over 1000 %" if relative >= 10.0 else f"{percent:.0f} %" if percent >= 10.0 else f"{percent:.2g} %"
            tag = Tag("not significant", "bad") if weak else None
            share = Cell(words, "unit", bar=relative, weak=weak, tag=tag)
        unit, meaning = Cell(superscripts(column.unit), "unit"), Cell(superscripts(column.meaning), "words")
        # Sums of inertias of the URDF that cancel leave rounding.
        cancelled = abs(nominal[k]) < NO_INERTIA * np.nanmax(np.abs(nominal), initial=0.0)
        stated = Cell(number(0.0 if cancelled else float(nominal[k]), 4), "num")
        rows.append([name(column.name), digits(value, std), stated, interval, unit, share, meaning])
    return Table(("name", "value", "URDF", "95 % interval", "unit", "std / value", "meaning"), rows, (1, 2, 3))


def digits(value: float, std: float) -> str:
    """Return a value to the second digit of its standard deviation."""
    if not np.isfinite(std) or std <= 0.0:
        return f"{value:.4g}"
    places = max(0, int(np.ceil(1.0 - np.log10(std))))
    return f"{value:z.{places}f}" if places <= 6 else f"{value:z.4g}"


def unsure(parameter: Parameter) -> str:
    """Return a standard deviation, or the interval where that says too little."""
    interval = parameter.interval
    if interval is None:
        return number(parameter.std, 2) if np.isfinite(parameter.std) else "unknown"
    return f"{ends(interval)} (95 %)" if np.any(np.isfinite(interval)) else "unknown"


def link_table(estimate: ConsistentEstimate) -> Table:
    """Return mass, centre of mass and inertia of every identified link."""
    rows: list[list[Cell | str]] = []
    for link in links(estimate):
        least = NO_INERTIA * max(abs(x) for x in link.inertia)
        com = (f"{x:z.3f}" for x in link.com)
        rows.append(
            [name(link.name), number(link.mass), *com, *("0" if abs(x) < least else number(x) for x in link.inertia)]
        )
    head = ["link", "mass [kg]", *(f"{axis} [m]" for axis in "xyz")]
    head += [f"I{axes} [kg m²]" for axes in ("xx", "xy", "xz", "yy", "yz", "zz")]
    return Table(head, rows, range(1, len(head)))


def correlation_group(estimate: Estimate) -> Group:
    """Return the correlation of the parameters as a heat map."""
    covariance = estimate.covariance
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    known = np.isfinite(std) & (std > 0.0) & ~estimate.undetermined
    values = np.full_like(covariance, np.nan)
    both = np.ix_(known, known)
    values[both] = covariance[both] / np.outer(std[known], std[known])
    names = estimate.model.names
    figure = single(
        "correlation",
        "Correlation of the parameters",
        "Blue: both errors have the same sign; vermillion: opposite signs. Of a strongly correlated pair the data determine only the sum or the difference well.",
        Matrix(names, names, values),
    )
    return Group("correlation-group", (figure,))


def strongest_pairs(estimate: Estimate) -> list[str]:
    """Return in words the pairs of parameters with the strongest correlation."""
    std = estimate.std
    known = np.isfinite(std) & (std > 0.0) & ~estimate.undetermined
    size = np.where(known, std, np.inf)
    with np.errstate(invalid="ignore"):
        correlation = np.triu(np.nan_to_num(estimate.covariance / np.outer(size, size), posinf=0.0, neginf=0.0), 1)
    order = np.argsort(-np.abs(correlation), axis=None)[:MAX_PAIRS]
    names = estimate.model.names
    pairs = [np.unravel_index(place, correlation.shape) for place in order]
    return [
        f"{names[i]} and {names[k]} ({correlation[i, k]:+.3f})"
        for i, k in pairs
        if abs(correlation[i, k]) >= STRONG_CORRELATION
    ]


def cheap_history(observations: Observations) -> History:
    """Return the course of a recursive estimate in few steps."""
    size = max(1, -(-observations.blocks // MAX_STEPS))
    joints = tuple(joint.grouped(size) for joint in observations.joints)
    with one_blas_thread():
        return rls(replace(observations, joints=joints, owner=observations.owner[::size]))[1]


def convergence_group(estimate: Estimate, history: History, observations: Observations) -> Group:
    """Return for every parameter how the recursive estimate settled."""
    counts = np.mean([joint.counts for joint in observations.joints], axis=0)
    ends = np.cumsum(np.bincount(observations.owner, counts))
    marks: list[Layer] = [Mark(float(end), "grey") for end in ends[:-1]] if len(ends) <= MAX_MARKS else []
    plots: dict[str, Plot] = {}
    for k, column in enumerate(estimate.model.columns):
        value, std = history.value[:, k], history.std[:, k]
        final = float(estimate.value[k])
        known = np.isfinite(value) & np.isfinite(std)
        if np.count_nonzero(known) < 2:
            continue
        # The first guesses may be wild; the picture is of how it settles.
        late = known & (np.arange(len(value)) >= len(value) // 5)
        late = late if np.any(late) else known
        low = min(final, float(np.min((value - 2.0 * std)[late])))
        high = max(final, float(np.max((value + 2.0 * std)[late])))
        pad = 0.05 * (high - low) or 1.0
        layers = (
            *marks,
            Band(history.samples, value - 2.0 * std, value + 2.0 * std, "blue", "± 2 std"),
            Line(history.samples, value, "blue", "estimate", 1.6),
            Level(final, "vermillion", "final"),
        )
        label = f"{column.name} [{superscripts(column.unit)}]"
        panel = Panel(label, layers, 120, (low - pad, high + pad))
        plots[column.name] = Plot("samples", (panel,), small=True)
    return _pages(plots, [column.name for column in estimate.model.columns])


def _pages(plots: Mapping[str, Plot], names: Sequence[str]) -> Group:
    """Return all figures, or pages of them to choose from where they are many."""
    if len(plots) <= MAX_FIGURES:
        figures = [
            single(f"converge-{k}", name, "", plots[name], quiet=True) for k, name in enumerate(names) if name in plots
        ]
        return Group("convergence-group", figures, (), "three")
    shown = [name for name in names if name in plots]
    pages = [shown[start : start + PER_PAGE] for start in range(0, len(shown), PER_PAGE)]
    figures = []
    for slot in range(PER_PAGE):
        variants: dict[tuple[int, ...], Drawing] = {
            (k,): plots[page[slot]] for k, page in enumerate(pages) if slot < len(page)
        }
        figures.append(Figure(f"converge-{slot}", "", "", variants, (0,), quiet=True))
    options = tuple(f"{page[0]} … {page[-1]}" if len(page) > 1 else page[0] for page in pages)
    return Group("convergence-group", figures, (Selector("parameters", options),), "three")
