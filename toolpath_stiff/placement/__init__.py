"""Where the work should sit: search or an earlier search's front, one placement chosen, analyzed, all said about it."""
