"""Pictures, pages and tables; here how figures are written for people: alike on terminal, pictures and pages."""
