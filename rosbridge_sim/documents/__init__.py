"""Files that users write: the form of their models, reading of JSON, YAML and XML, and the words for mistakes."""
