"""The work of the commands `rosbridge-sim mock ...`."""
