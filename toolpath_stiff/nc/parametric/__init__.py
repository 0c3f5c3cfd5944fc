"""Programs with variables, expressions, loops and macro calls: values are worked out, then blocks run as any others.

`statements` reads a line, `expressions` its values, `variables` holds what `#` names, `run` goes from block to block.
"""
