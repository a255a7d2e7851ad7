"""A rosbridge v2 server without ROS, with a driving world inside that answers like MORAI SIM: Drive."""
