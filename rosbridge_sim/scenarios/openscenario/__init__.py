"""OpenSCENARIO 1.0 to 1.3: reading of files, and the model of a story."""
