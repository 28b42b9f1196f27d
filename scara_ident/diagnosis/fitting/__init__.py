"""Nonlinear parameters fitted together with all others, and corrections of the data."""
