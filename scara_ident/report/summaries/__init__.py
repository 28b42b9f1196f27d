"""What a result tells in Python, a module for each kind: `summary`, `columns` of a data frame, and `figure`."""
