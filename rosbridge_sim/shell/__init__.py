"""The packages that use sockets, clocks, the disk and tasks; all other packages work without them."""
