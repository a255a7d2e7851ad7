"""The web page of the server: its files, and its JavaScript modules joined into one file."""
