"""Results in Python: `summary`, `columns` of a data frame, and `figure`, a module for each kind."""
