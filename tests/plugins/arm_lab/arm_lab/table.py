"""Tables of our own logger: the names behind a ``#``, then numbers with blanks between."""

import numpy as np


def column_names(path):
    """Return the names in the first line."""
    return path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ").split()


def read_columns(path, names):
    """Return some columns."""
    table = dict(zip(column_names(path), np.loadtxt(path, unpack=True), strict=True))
    return {name: table[name] for name in names}
