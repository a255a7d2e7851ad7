"""The checks of a rosbridge: what is sent, what must come, and the verdict; without sockets.

`checks/*.jsonl` has all checks but those of the connection itself. The tests of this server play the same files.
"""
