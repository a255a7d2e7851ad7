"""Kinds of sensors: their options, messages, drawing and errors."""
