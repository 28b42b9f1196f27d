"""Candidates: members of each effect, spectral lines, their columns, and what their nonlinear parameters may be."""
