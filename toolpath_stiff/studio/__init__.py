"""The studio: a case in the browser, opened and served until it is closed. No physics, no statistics here."""
