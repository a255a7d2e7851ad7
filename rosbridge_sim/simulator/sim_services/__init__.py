"""This simulator's own topics and services under `/sim/`, one component for each subject."""
