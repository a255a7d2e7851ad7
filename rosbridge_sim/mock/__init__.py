"""Mocks of robots: the model of their file, the values of their topics, services and actions, and faults.

Pure: no sockets, clocks or files. `shell/mocking/` runs a mock.
"""
