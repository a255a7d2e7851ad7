"""Campaigns without processes and files: what is driven, how it is judged, and the tables and pages of the results."""
