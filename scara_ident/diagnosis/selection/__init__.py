"""Stepwise selection, forward and backward, what it leaves open, and what cannot be told apart."""
