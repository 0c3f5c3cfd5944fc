"""Programs with variables, expressions, loops and macro calls: values are computed, then blocks run like any others."""
