"""Services and topics that list, add and move sensors."""
