"""Contracts: what an app relies on, as a file; what was seen of a system; and whether both agree. No sockets."""
