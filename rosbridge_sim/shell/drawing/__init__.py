"""Drawing outside the server's thread: the process for cameras and lidars, and maps as pictures."""
