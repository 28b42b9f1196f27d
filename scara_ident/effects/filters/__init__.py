"""Low-pass filters through which torque or positions went before they were logged, and when friction then turns."""
