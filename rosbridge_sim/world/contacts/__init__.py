"""Contacts between entities: found, predicted, and what impacts do."""
