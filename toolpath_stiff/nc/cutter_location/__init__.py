"""Cutter-location files: the points, tool axes and feeds that CAM systems hand to post processors, in APT's words.

`reading` is the way in, for `Program` and for `tps check`. `statements` splits lines; `vocabulary` is the table of
words, whose functions stand in `modes`, `motion` and `cycles`; each takes the `state` and a statement. `tool_path`
makes moves of what `geometry` computes.
"""
