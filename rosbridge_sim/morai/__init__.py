"""What MORAI calls things."""
