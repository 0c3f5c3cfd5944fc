"""The studio: a case in the browser, opened and served until it is ended. No physics, no statistics here."""
