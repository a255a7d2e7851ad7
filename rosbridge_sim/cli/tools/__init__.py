"""The tools for users without ROS: over a rosbridge, they do what `rostopic`, `rosservice` and `rosmsg` do."""
