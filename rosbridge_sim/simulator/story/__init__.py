"""Stories of OpenSCENARIO as they are told: actors, actions, conditions, and the component that runs them."""
