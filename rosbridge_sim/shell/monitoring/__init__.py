"""State of the server for people and programs that watch it: log, metrics, refusals, topics about clients."""
