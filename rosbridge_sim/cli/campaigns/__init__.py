"""The commands for campaigns."""
