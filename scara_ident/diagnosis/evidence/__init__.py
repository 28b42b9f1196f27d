"""Whether what is left is noise, and what a search leaves if it is not."""
