"""The state of the world: arrays with a row for each entity, and the functions that write them."""
