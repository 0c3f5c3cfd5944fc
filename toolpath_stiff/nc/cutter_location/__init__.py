"""Cutter-location files: the points, tool axes and feeds that CAM systems hand to post processors, in APT's words.

`statements` reads lines; `vocabulary` knows what words mean; `circles`, `tilting` and `cycles` do the geometry;
`tool_path` makes moves; `modes`, `curves` and `reading` execute statements; `program` and `checking` are the way in.
"""
