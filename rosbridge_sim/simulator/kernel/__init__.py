"""The parts that every component shares: context, hooks, egos, and the steps of frames."""
