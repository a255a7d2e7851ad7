"""Motion of driven vehicles: tyres, actuators, ground, and readings of sensors on them."""
