"""Cutter-location files: points, tool axes and feeds that CAM systems pass to post-processors, in APT's words."""
