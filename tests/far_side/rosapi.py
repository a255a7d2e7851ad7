"""The rosapi services of the far bridge: a node of its own, which not every machine starts."""

from __future__ import annotations

import json
from collections.abc import Callable

from rosbridge_sim.schema.definitions.parse import Definition, Field
from tests.far_side.graph import Graph, Service, Topic
from tests.far_side.messages import Json, RosError, now

__all__ = ["add_rosapi"]

_NODE = "/rosbridge_websocket"
"""Who serves and publishes everything that came by rosbridge."""

_EXAMPLES = {"string": "", "bool": "False", "float32": "0.0", "float64": "0.0"}


def add_rosapi(graph: Graph) -> None:
    """Serve `/rosapi/*`."""

    def of_topic(key: str, answer: Callable[[Topic | None], object]) -> Callable[[Json], Json]:
        return lambda args: {key: answer(graph.registered.get(args["topic"]))}

    def of_service(key: str, answer: Callable[[Service | None], object]) -> Callable[[Json], Json]:
        return lambda args: {key: answer(graph.services.get(args["service"]))}

    def topics(_: Json) -> Json:
        known = graph.registered
        return {"topics": list(known), "types": [topic.definition.name for topic in known.values()]}

    def details(find: Callable[[str], Definition]) -> Callable[[Json], Json]:
        """Of a type and all within it. One that is not known there fails, with what rospy makes of the error."""

        def answer(args: Json) -> Json:
            try:
                return {"typedefs": [_typedef(one) for one in graph.types.tree(find(args["type"]))]}
            except RosError as error:
                failed = f"error processing request: {error}".encode()
                raise RosError(f"service responded with an error: {failed!r}") from None

        return answer

    answers: dict[str, tuple[str, Callable[[Json], Json]]] = {
        "topics": ("Topics", topics),
        "topic_type": ("TopicType", of_topic("type", _topic_type)),
        "services": ("Services", lambda _: {"services": sorted(graph.services)}),
        "service_type": ("ServiceType", of_service("type", lambda service: service.type if service else "")),
        "service_node": ("ServiceNode", of_service("node", _service_node)),
        "nodes": ("Nodes", lambda _: {"nodes": ["/rosapi", _NODE]}),
        "publishers": (
            "Publishers",
            of_topic("publishers", lambda topic: [_NODE] if topic and topic.has_publisher else []),
        ),
        "subscribers": (
            "Subscribers",
            of_topic("subscribers", lambda topic: [_NODE] if topic and topic.subscriptions else []),
        ),
        "get_time": ("GetTime", lambda _: {"time": now()}),
        "get_param": ("GetParam", lambda args: {"value": json.dumps(graph.parameters.get(args["name"]))}),
        "message_details": ("MessageDetails", details(graph.types.message)),
        "service_request_details": ("ServiceRequestDetails", details(lambda name: graph.types.service(name)[0])),
        "service_response_details": ("ServiceResponseDetails", details(lambda name: graph.types.service(name)[1])),
    }
    for name, (kind, handler) in answers.items():
        request, response = graph.types.service(f"rosapi/{kind}")
        full = f"/rosapi/{name}"
        graph.services[full] = Service(full, f"rosapi/{kind}", request, response, handler=handler)


def _topic_type(topic: Topic | None) -> str:
    return topic.definition.name if topic else ""


def _service_node(service: Service | None) -> str:
    if service is None:
        return ""
    return _NODE if service.provider is not None else "/rosapi"


def _typedef(definition: Definition) -> Json:
    fields = definition.fields
    return {
        "type": definition.name,
        "fieldnames": [field.name for field in fields],
        "fieldtypes": [field.type for field in fields],
        "fieldarraylen": [-1 if field.array is None else field.array for field in fields],
        "examples": [_example(field) for field in fields],
    }


def _example(field: Field) -> str:
    if field.array is not None:
        return "[]"
    return "{}" if "/" in field.type else _EXAMPLES.get(field.type, "0")
