"""The packages that use sockets, clocks, the disk and tasks; everything below them does without."""
