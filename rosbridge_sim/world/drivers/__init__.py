"""The driver model: what a driver sees, wants and yields to, one row for each vehicle on lanes."""
