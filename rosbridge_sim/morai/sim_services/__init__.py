"""Services of our own under `/sim`: time and the world as a tool for programs."""
