"""What is identified: a URDF with what a URDF cannot say."""
