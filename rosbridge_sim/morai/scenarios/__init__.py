"""Scenario documents: MORAI's JSON -> entities to add to the world, or a list of mistakes."""
