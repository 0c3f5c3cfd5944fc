"""Where the work should sit: searching placements, and the case study of the paper."""
