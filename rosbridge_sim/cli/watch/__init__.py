"""`rosbridge-sim watch`: the scene in a terminal."""
