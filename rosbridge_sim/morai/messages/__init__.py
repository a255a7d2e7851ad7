"""World state -> MORAI's messages, and MORAI's commands -> world state."""
