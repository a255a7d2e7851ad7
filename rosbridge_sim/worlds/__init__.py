"""Worlds without a server: many of them in one set of arrays, for programs that learn or search; see `worlds`."""
