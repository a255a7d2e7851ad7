"""Services under `/sim`, which MORAI SIM does not have: time as a tool, the population, the road."""
