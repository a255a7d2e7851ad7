"""A node on the graph of ROS 2: the only room that imports a DDS implementation, when it is used."""
