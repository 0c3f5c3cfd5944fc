"""A program written for another placement, or its placement as offsets to key in at the control; knows no stiffness."""
