"""What was found, judged on recordings that had no part in finding it."""
