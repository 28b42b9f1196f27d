"""What else may have produced a candidate: noise, runs that differ, filters, setpoints, another minimum or law."""
