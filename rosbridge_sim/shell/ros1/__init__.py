"""A node on the graph of ROS 1: its sockets, on the event loop."""
