"""The graph of one process: topics, services, actions and parameters, and the participants that use them."""
