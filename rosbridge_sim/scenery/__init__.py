"""The scene as triangles, and the geometry of cameras and lidars: arrays in, arrays out."""
