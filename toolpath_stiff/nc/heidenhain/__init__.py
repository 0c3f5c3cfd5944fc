"""Heidenhain's plain language (TNC 426 to 640): its statements act on the one state of a control."""
