"""The missing effect added: fitted, judged, written to a machine file with its origin."""
