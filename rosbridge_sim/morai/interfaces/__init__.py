"""Topics and services of the simulator, by name, with their settings."""
