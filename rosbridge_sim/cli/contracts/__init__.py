"""`rosbridge-sim contract` and `mock capture`: look at a running system or a bag, and write or judge what was seen."""
