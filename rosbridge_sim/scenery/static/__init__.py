"""The static parts of a scene as one mesh: roads, paint, ground, signs, lights, and the surroundings of roads."""
