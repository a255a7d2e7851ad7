"""MORAI SIM's names, messages, files and services over the bus and the simulated world."""
