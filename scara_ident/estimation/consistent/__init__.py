"""What a real arm can have: bodies, friction, limits, and the programme that keeps an estimate within them."""
