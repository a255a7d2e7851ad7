"""Running stories of OpenSCENARIO: actors, actions, conditions, and the component that runs them."""
