"""The torque equation, linear in its parameters."""
