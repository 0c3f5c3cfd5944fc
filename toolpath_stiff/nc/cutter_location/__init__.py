"""Cutter-location files: the points, tool axes and feeds that CAM systems hand to post processors, in APT's words."""
