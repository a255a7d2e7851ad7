"""The rosbridge wire of one peer: bytes to ops and back, without I/O."""
