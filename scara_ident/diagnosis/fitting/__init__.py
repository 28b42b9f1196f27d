"""Nonlinear parameters with all others, and what is taken out of the data."""
