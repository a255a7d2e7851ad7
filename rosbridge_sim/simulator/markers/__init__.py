"""The map and the scene as markers and drawings."""
