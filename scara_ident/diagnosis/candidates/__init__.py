"""What may be missing: the members of each effect, spectral lines, their columns, and what none of them can be."""
