"""Pure geometry in the plane: angles, polylines, grids, pairs of places."""
