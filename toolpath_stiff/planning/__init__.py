"""Plans of what to measure: a first campaign, or the next readings."""
