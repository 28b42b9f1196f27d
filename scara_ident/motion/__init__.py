"""From recorded positions to motion."""
