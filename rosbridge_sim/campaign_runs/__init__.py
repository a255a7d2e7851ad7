"""Campaigns with processes and files: workers, programs, folders of results."""
