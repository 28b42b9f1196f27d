"""The joint-torque regressor, generated for one arm."""
