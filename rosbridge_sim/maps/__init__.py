"""Maps in a form that knows no file format, and one reader for each format."""
