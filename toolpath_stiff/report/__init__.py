"""Pictures, pages and tables of results, with the same words on terminal, pictures and pages."""
