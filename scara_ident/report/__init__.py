"""What a person and a program are told: JSON, terminal tables, figures."""
