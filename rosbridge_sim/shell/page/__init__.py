"""The web page of the server: its files, its JavaScript modules joined into one file, and the map that it draws."""
