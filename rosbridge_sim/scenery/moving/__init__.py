"""The moving parts of a scene as one mesh: shapes, colours and lamps of vehicles and people."""
