"""The population of the world and its map."""
