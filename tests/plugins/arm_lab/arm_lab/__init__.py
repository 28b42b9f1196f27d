"""What a laboratory adds to scara-ident, without a change of it."""
