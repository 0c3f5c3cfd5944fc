"""Programs posted for another machine: its kinematics, and the tool on the part recovered through it."""
