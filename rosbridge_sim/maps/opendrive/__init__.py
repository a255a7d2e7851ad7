"""OpenDRIVE files (ASAM OpenDRIVE 1.4 to 1.8, the part that public maps use) -> the simulator's form of a map."""
