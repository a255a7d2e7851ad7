"""ROS 2 without ROS: a gateway between the bus and a node on the graph of ROS 2."""
