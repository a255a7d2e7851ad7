"""This simulator's own topics and services under `/sim/`, one component for each subject.

A new service needs a `Component` here, a row in `make_node` of `simulator/node_factory.py`, and its definition in
`schemas/rosbridge_sim_msgs/srv`.
"""
