"""Values as plain data and bytes, with bounds; readers that run in a thread."""
