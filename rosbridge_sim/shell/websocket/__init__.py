"""The WebSocket server, the connections of its clients, and the connection to a remote bridge."""
