"""What readings say of a model: noise, candidates, evidence, gates, fits, a verdict."""
