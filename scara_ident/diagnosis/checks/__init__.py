"""What may have made a candidate instead: noise, runs that differ, filters, setpoints, another minimum or law."""
