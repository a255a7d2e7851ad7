"""Services that tell the graph and its parameters: those of rosapi, and those that each node of ROS 2 has."""
