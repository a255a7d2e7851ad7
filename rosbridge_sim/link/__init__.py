"""Connection of a client program to a rosbridge server: URLs, the WebSocket client, texts for terminals."""
