"""The simulator's items on the bus: publishers, subscribers, services, and their names and rates."""
