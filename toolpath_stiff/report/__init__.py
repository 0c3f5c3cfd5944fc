"""Pictures, pages and tables of results, alike on terminal, pictures and pages."""
