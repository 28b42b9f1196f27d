"""Whether the residual is noise, and what a search leaves if it is not."""
