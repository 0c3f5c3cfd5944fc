"""The studio: a case in the browser. It shows what the public functions give; no physics, no statistics here."""
