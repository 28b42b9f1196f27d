"""What was found, on recordings that had no part in finding it."""
