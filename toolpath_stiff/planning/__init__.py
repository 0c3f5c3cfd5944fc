"""Plans of what to measure next, or first."""
