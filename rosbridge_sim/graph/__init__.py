"""Who talks to whom in this process."""
