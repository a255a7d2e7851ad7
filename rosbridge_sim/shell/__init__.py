"""The only room with sockets, clock, disk and tasks."""
