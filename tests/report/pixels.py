"""What a picture shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scara_ident.report.drawing import COLORS


def share(path: Path, color: str) -> float:
    """Return the share of a picture's pixels that have a colour."""
    from matplotlib.image import imread

    wanted = np.array([int(COLORS[color][k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
    return float(np.mean(np.all(np.abs(imread(path)[..., :3] - wanted) < 0.02, axis=-1)))
