"""The tools for people without ROS: what `rostopic`, `rosservice` and `rosmsg` are to others, over a rosbridge."""
