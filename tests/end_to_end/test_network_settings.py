"""Network settings in use: a file at the start, another with a scenario, and a recording."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Connect, Serve, Simulate
from tests.shell.bags.bag_reading import read_bag

AT_START = """
[publishers]
"/Ego_topic" = { name = "/car/state" }
"/Object_topic" = { rate = 10 }
[services]
"/Morai_TLSrv" = { on = false }
"""

WITH_SCENARIO = """
port = 1234  # from a whole settings file: passed over
[publishers]
"/Ego_topic" = { name = "/other/state" }
"/SyncModeInfo" = { name = "/other/mode" }
[subscribers]
"/ctrl_cmd" = { name = "/other/drive" }
[services]
"/Service_MoraiSL" = { name = "/other/load" }
"""

LOAD = {
    "file_name": "demo",
    "delete_all": True,
    "load_ego_vehicle_data": True,
    "load_network_connection_data": True,
}


@pytest.mark.slow
async def test_scenario_changes_topic_names_while_clients_stay_connected(
    serve: Serve, connect: Connect, tmp_path: Path
) -> None:
    config, bag = tmp_path / "s.toml", tmp_path / "drive.mcap"
    config.write_text(AT_START)
    network = tmp_path / "data" / "Network" / "demo.toml"
    network.parent.mkdir(parents=True)
    server = serve("--config", str(config), "--data-dir", str(tmp_path / "data"), "--record", str(bag))
    client = await connect(server.url)
    await client.subscribe("/car/state")
    await client.message("/car/state")

    network.write_text('[services]\n"/SyncModCmd" = { on = false }\n')
    assert (await client.ask("/Service_MoraiSL", **LOAD))["result"] is False
    (told,) = [frame for frame in client.inbox if frame["op"] == "status"]
    assert f"{network}:2: services." in told["msg"]
    assert "did you mean /SyncModeCmd?" in told["msg"]
    await client.message("/car/state")

    network.write_text(WITH_SCENARIO)
    assert (await client.ask("/Service_MoraiSL", **LOAD))["result"] is True
    await client.settle()
    node = await client.values("/rosapi/node_details", {"node": "/morai_sim"})
    assert {"/other/state", "/other/mode", "/Object_topic"} <= set(node["publishing"])
    assert {"/car/state", "/Ego_topic", "/SyncModeInfo"}.isdisjoint(node["publishing"])
    assert "/ctrl_cmd" not in node["subscribing"]
    assert {"/Service_MoraiSL", "/Morai_TLSrv"}.isdisjoint(node["services"])

    await client.subscribe("/other/state")
    await client.subscribe("/other/mode")
    assert (await client.message("/other/mode"))["status"] is False, "what is latched is there under its new name"
    await client.send("publish", topic="/other/drive", msg={"longlCmdType": 2, "velocity": 30.0})
    await client.message_where("/other/state", lambda status: status["velocity"]["x"] > 0.5)
    assert not [frame for frame in client.inbox if frame.get("topic") == "/car/state"]
    assert (await client.ask("/other/load", **LOAD))["result"] is True
    server.stop_cleanly()
    topics = {topic for topic, _, _ in read_bag(bag)}
    assert {"/car/state", "/other/state", "/other/drive", "/SyncModeInfo", "/other/mode"} <= topics


@pytest.mark.slow
@pytest.mark.parametrize("simulate", ["serve", "attach", "quirks"], indirect=True)
async def test_client_that_changes_the_names_gets_its_answer_with_serve_and_attach(
    simulate: Simulate, connect: Connect, tmp_path: Path
) -> None:
    network = tmp_path / "data" / "Network" / "demo.toml"
    network.parent.mkdir(parents=True)
    network.write_text(WITH_SCENARIO + '"/SyncModeWaitForTick" = { name = "/other/tick" }\n')
    client = await connect(simulate("--start", "sync", "--data-dir", str(tmp_path / "data")).url)
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    assert (await client.ask("/SyncModeScenarioLoad", frame=2, **LOAD))["result"] is True
    for frame in (1, 2):
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame)
        assert (answer["tick_status"], answer["frame"]) == (True, frame)
    answer = await client.ask("/other/tick", user_id="me", frame=3)
    assert (answer["tick_status"], answer["frame"]) == (True, 3)
    assert (await client.ask("/other/load", **LOAD))["result"] is True
    await client.subscribe("/other/state")
    await client.ask("/other/tick", user_id="me", frame=4)
    await client.message("/other/state")
