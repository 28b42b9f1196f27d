"""The identified robot in the formats of other programs."""
