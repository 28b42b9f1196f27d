"""Draw the figures of ``docs/campaign.md`` from the campaign's JSON.

Run ``python benchmarks/campaign_figures.py [--input FILE.json] [--output FOLDER]``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

RIVALS = ("none", "wider_filter")
INK, GREY, BLUE, ORANGE = "#222222", "#9a9a9a", "#1f5fa8", "#d9822b"


def best_of_each(content: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the nearest size of every effect, and none; nearest first."""
    found: dict[str, dict[str, Any]] = {}
    for item in content["scan"]:
        found.setdefault(item["name"], item)
    return list(found.values())


def draw_scan(content: dict[str, Any], path: Path) -> None:
    """Distance of every effect's nearest size from the printed tables."""
    import matplotlib.pyplot as plt

    items = best_of_each(content)[::-1]
    figure, axes = plt.subplots(figsize=(7.0, 5.2), layout="constrained")
    for row, item in enumerate(items):
        one, mean = item["one_run"], item["mean_of_six"]
        colour = ORANGE if item["name"] in RIVALS else BLUE
        axes.plot(one["range"], [row, row], color=colour, lw=2)
        axes.plot(one["distance"]["both"], row, "o", color=colour, ms=5)
        axes.plot(mean["distance"]["both"], row, "o", mfc="none", color=GREY, ms=5)
    axes.set_yticks(
        range(len(items)), [f"{i['name']} × {i['factor']:g}" if i["name"] != "none" else "none" for i in items]
    )
    axes.plot([], [], "o-", color=BLUE, label="noise of one run: median,\n5 to 95 % of draws")
    axes.plot([], [], "o", mfc="none", color=GREY, label="noise of the mean of six")
    axes.plot([], [], "o-", color=ORANGE, label="the same without an effect")
    axes.legend(loc="lower left", fontsize=7, frameon=False)
    axes.set_xlabel("rms of log10(virtual / printed), cells of Tables 2 and 4")
    axes.set_xlim(left=0.0)
    axes.grid(axis="x", color="#e5e5e5")
    axes.set_axisbelow(True)
    _finish(figure, axes, path)


def draw_ranking(content: dict[str, Any], path: Path) -> None:
    """Average prediction error of every trajectory's parameters against its J_d and its J_k."""
    import matplotlib.pyplot as plt

    names = content["trajectories"]
    sources = {"printed": content["printed"], **content["campaigns"]}
    figure, grid = plt.subplots(2, 2, figsize=(7.0, 5.0), layout="constrained", sharey="row")
    for row in range(2):
        for axes, key, label in zip(grid[row], ("log_det", "condition"), ("J_d", "J_k"), strict=True):
            for (name, tables), colour, mark in zip(sources.items(), (INK, ORANGE, BLUE), "os^", strict=False):
                average = np.array(tables["complete"])[:, :, row].mean(axis=0)
                x = np.array(tables[key])
                axes.plot(x, average, mark, color=colour, ms=5, label=name)
                if name == "printed":
                    for k, trajectory in enumerate(names):
                        axes.annotate(
                            trajectory, (x[k], average[k]), xytext=(4, 4), textcoords="offset points", fontsize=8
                        )
            axes.set_yscale("log")
            if key == "condition":
                axes.set_xscale("log")
            if row == 1:
                axes.set_xlabel(label)
            axes.grid(color="#e5e5e5")
            axes.set_axisbelow(True)
        grid[row, 0].set_ylabel(f"joint {row + 1}: average error [N m]")
    grid[0, 1].legend(fontsize=8, frameon=False)
    _finish(figure, grid.flat, path)


def draw_cells(content: dict[str, Any], path: Path) -> None:
    """Table 2 as printed and as simulated, colours by the logarithm."""
    import matplotlib.pyplot as plt

    names = content["trajectories"]
    sources = {"printed": content["printed"], **content["campaigns"]}
    figure, grid = plt.subplots(2, len(sources), figsize=(2.6 * len(sources), 5.0), layout="constrained")
    for column, (name, tables) in enumerate(sources.items()):
        cells = np.array(tables["complete"])
        for row in range(2):
            axes = grid[row, column]
            low, high = ((0.04, 6.0), (0.012, 0.2))[row]
            axes.imshow(np.log10(cells[:, :, row]), cmap="Blues", vmin=np.log10(low), vmax=np.log10(high))
            for i in range(len(names)):
                for k in range(len(names)):
                    value = cells[i, k, row]
                    dark = np.log10(value / low) > 0.6 * np.log10(high / low)
                    axes.text(
                        k, i, f"{value:.3f}", ha="center", va="center", fontsize=7, color="white" if dark else INK
                    )
            axes.set_xticks(range(len(names)), names if row else [], fontsize=8)
            axes.set_yticks(range(len(names)), [] if column else names, fontsize=8)
            axes.tick_params(length=0)
            if row == 0:
                axes.set_title(name, fontsize=9)
        if column == 0:
            for row in range(2):
                grid[row, 0].set_ylabel(f"joint {row + 1}: predicted")
        grid[1, column].set_xlabel("estimated on")
    _finish(figure, (), path)


def _finish(figure: Any, axes: Any, path: Path) -> None:
    import matplotlib.pyplot as plt

    for each in np.atleast_1d(np.asarray(list(axes) if hasattr(axes, "__iter__") else axes, dtype=object)):
        each.spines[["top", "right"]].set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw(content: dict[str, Any], folder: Path) -> None:
    """Draw all figures."""
    import matplotlib

    matplotlib.use("Agg")
    draw_scan(content, folder / "campaign_effects.png")
    draw_ranking(content, folder / "campaign_ranking.png")
    draw_cells(content, folder / "campaign_table2.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--input", type=Path, default=Path("benchmarks/results/campaign.json"))
    parser.add_argument("--output", type=Path, default=Path("docs/figures"))
    options = parser.parse_args()
    draw(json.loads(options.input.read_text(encoding="utf-8")), options.output)


if __name__ == "__main__":
    main()
