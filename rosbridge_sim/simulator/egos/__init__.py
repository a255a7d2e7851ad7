"""The egos as clients see them: their state and registry, and their frames on `/tf`."""
