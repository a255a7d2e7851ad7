"""Definition text to compiled types."""
