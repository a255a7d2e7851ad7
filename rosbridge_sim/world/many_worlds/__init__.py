"""Many worlds in one set of columns, which one step moves; see `batch`."""
