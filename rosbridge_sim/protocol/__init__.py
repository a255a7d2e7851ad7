"""The rosbridge wire for one peer: bytes to ops and back, without I/O."""
