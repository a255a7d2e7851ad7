"""MORAI's topics and services, one component for each subject."""
