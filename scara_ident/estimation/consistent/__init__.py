"""Estimates within what a real arm can have: bodies with mass, friction that brakes, known limits."""
