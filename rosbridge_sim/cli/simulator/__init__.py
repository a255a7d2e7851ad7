"""The tools for a running simulator: its score, sensors, snapshots and objects, and viewers that show it."""
