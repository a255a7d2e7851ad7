"""Settings: what they are, and how they are read from flags, variables and a file."""
