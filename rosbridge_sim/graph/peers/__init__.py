"""One client on the bus: its topics, services and actions."""
