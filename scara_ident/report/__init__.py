"""What a person and a program read: JSON, terminal tables, figures."""
