"""One run: what was recorded, and whether to believe it."""
