"""Services of our own under `/sim/`, which MORAI SIM does not have."""
