"""Inference from readings to a verdict: noise, candidates, fits, gates, probabilities."""
