"""Forward and back from one model to the next, what stays open of that, and what cannot be told apart."""
