"""`rosbridge-sim doctor`: the connections and the command that run the checks of `rosbridge_sim/doctor/`."""
