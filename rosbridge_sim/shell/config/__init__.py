"""The settings, and how flags, variables and a file set them."""
