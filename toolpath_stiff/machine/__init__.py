"""Machine files, kinematics and limits of six-strut platforms."""
