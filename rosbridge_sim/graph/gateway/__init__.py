"""A gateway between the bus and the nodes of a graph of ROS, whose protocol another room knows."""
