"""Whether a candidate beside the fitted model is more than chance, and whether anything is missing at all."""
