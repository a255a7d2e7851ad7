"""Data of sensors: points of lidars, boxes of pictures, their messages, and the files of a capture."""
