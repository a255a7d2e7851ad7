"""MORAI's scenario files, read, checked and placed on the roads; the catalogue of models."""
