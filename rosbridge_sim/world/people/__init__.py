"""People on foot: where they walk, wait and cross."""
