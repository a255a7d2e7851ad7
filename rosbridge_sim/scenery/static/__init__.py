"""What stands still in a scene, as one mesh: roads, paint, ground, signs, lights, and what stands beside roads."""
