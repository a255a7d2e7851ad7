"""Network files in MORAI's own form."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.bus.morai_network import MAX_ITEMS, is_morai_network, read_morai_network
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice, NetworkSettings


def item(number: int, division: int, topic: str = "", way: int = 3, rate: object = 50) -> dict[str, Any]:
    """An item as MORAI writes it; a control command has its way in another block."""
    ros = {"RosBridgeIP": "10.0.0.2", "RosBridgePort": "9090", "Topic": topic}
    config = {"commType": way, "pubFrequency": rate, "rosConfig": ros}
    unset = {"commType": 0, "rosConfig": {"Topic": ""}}
    command = {"egoCtrlMode": 1, "commType": way, "ctrlSleepTime": 20, "rosConfig": ros}
    is_command = division == 3
    return {
        "netType": 0,
        "PUBSUB_TYPE": number,
        "Division_TYPE": division,
        "config": unset if is_command else config,
        "EgoCtrlConfig": command if is_command else unset,
    }


def document(*items: object, owner: object = 0) -> dict[str, Any]:
    return {"egoNetworkData": [{"UNIQUEID": owner, "listEgoNetworkInfo": list(items)}]}


def test_topics_rates_and_renames_of_the_known_items_are_read() -> None:
    network, unused = read_morai_network(
        document(
            item(771, 3, "/car/drive"),
            item(261, 1, "CollisionData", rate="30"),
            item(278, 1, "/things", rate=20),
            item(780, 4, "/Service_MoraiEventCmd"),
            item(4711, 1, "/Ego_topic", rate=25.0),
        ),
        "net.json",
    )
    assert network == NetworkSettings(
        publishers={
            "/CollisionData": InterfaceChoice("/CollisionData", rate=30.0),
            "/Object_topic": InterfaceChoice("/things", rate=20.0),
            "/Ego_topic": InterfaceChoice("/Ego_topic", rate=25.0),
        },
        subscribers={"/ctrl_cmd": InterfaceChoice("/car/drive")},
        services={"/Service_MoraiEventCmd": InterfaceChoice("/Service_MoraiEventCmd")},
    )
    assert not unused


def test_what_has_no_meaning_here_is_listed() -> None:
    whole = document(item(770, 1, way=1), item(295, 1, "/x"), item(278, 1, "", rate=500), item(261, 1, way=0))
    whole["egoNetworkData"].append({"UNIQUEID": 7, "listEgoNetworkInfo": [item(278, 1, "/other")]})
    network, unused = read_morai_network(whole | {"frameRate": [30]}, "net.json")
    assert network == NetworkSettings(publishers={"/Object_topic": InterfaceChoice()})
    assert unused == [
        "type 770 by UDP",
        "type 295 (/x), which is not known",
        "pubFrequency 500 of type 278",
        "type 261 by no connection",
        "type 278 (/other) of ego 7, which is not the first one",
        "frameRate",
    ]


@pytest.mark.parametrize(
    ("whole", "words"),
    [
        (document(7), r"net.json: egoNetworkData\[0\].listEgoNetworkInfo\[0\]: expected an object"),
        ({"egoNetworkData": [7]}, r"egoNetworkData\[0\]: expected an object, got 7"),
        ({"egoNetworkData": [{"listEgoNetworkInfo": 7}]}, r"\[0\].listEgoNetworkInfo: expected a list, got 7"),
        (document(*[item(1, 1)] * (MAX_ITEMS + 1)), "expected at most 1,000 items"),
        (document(item(278, 1, "two words")), "expected the name of a topic or service, without blanks"),
    ],
)
def test_mistake_names_its_place(whole: dict[str, Any], words: str) -> None:
    assert is_morai_network(whole)
    with pytest.raises(DocumentError, match=words):
        read_morai_network(whole, "net.json")


@pytest.mark.parametrize("value", [None, "x", [], 1e400, "nan", 10**400, True])
def test_odd_values_are_no_error(value: object) -> None:
    odd = {"PUBSUB_TYPE": value, "Division_TYPE": value, "config": value, "EgoCtrlConfig": value}
    network, unused = read_morai_network(document(odd, owner=value), "net.json")
    assert network == NetworkSettings()
    assert unused
