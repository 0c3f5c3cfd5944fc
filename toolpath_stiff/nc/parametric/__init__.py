"""Programs with variables, expressions, loops and macro calls: values are worked out, then blocks run as any others."""
