"""Siemens' language (Sinumerik 840D, 828D): its words act on the one state of a control."""
