"""Scenario documents: MORAI's JSON -> who is to come, and what is wrong with it."""
