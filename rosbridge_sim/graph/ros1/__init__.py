"""ROS 1 without ROS: what a node there says and knows, without sockets."""
