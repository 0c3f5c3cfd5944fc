"""The studio: a case in the browser. What it shows comes from the public functions; it adds no physics, no statistics."""
