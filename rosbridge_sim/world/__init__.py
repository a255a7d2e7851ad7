"""The driving world: SI units, numpy, no ROS."""
