"""Commands that read files and need no server."""
