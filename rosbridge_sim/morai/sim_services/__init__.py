"""The simulator's services that MORAI SIM does not have: time as a tool, the population, the road."""
