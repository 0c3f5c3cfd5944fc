"""From readings to a verdict: noise, candidates, fits, gates, probabilities."""
