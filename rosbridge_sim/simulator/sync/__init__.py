"""Synchronous mode and the barrier as tables of states; they know neither bus nor world."""
