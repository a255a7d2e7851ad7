"""Files that are read for clients and written for them."""
