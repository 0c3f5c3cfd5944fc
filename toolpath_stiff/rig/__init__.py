"""Blind simulator of measuring campaigns on a machine with a hidden fault; shares no mechanics with the stack."""
