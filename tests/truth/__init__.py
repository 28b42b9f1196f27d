"""What once was told wrongly, from recordings to the verdict, on arms of which everything is known."""
