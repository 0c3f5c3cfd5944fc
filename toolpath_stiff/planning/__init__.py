"""What to measure next, or first."""
