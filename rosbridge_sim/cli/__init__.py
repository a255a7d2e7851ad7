"""The commands of the shell: what a user types, and the tools behind it."""
