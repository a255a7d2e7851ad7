"""The simulator behind another rosbridge."""
