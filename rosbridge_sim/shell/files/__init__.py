"""Files that are read or written for clients."""
