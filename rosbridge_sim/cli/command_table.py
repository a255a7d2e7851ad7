"""The table of all commands but `serve` and `attach`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rosbridge_sim.cli.bag_commands import run_bag, run_record
from rosbridge_sim.cli.bridge_commands import run_layout, run_service, run_topic, run_wait
from rosbridge_sim.cli.campaign_commands import run_campaign
from rosbridge_sim.cli.file_commands import run_docs, run_interface, run_map, run_scenario, run_schema
from rosbridge_sim.cli.graph_commands import run_action, run_node, run_param
from rosbridge_sim.cli.picture_commands import run_clip, run_shot
from rosbridge_sim.cli.ros2_commands import run_ros2
from rosbridge_sim.cli.simulator_commands import (
    run_restore,
    run_score,
    run_sensor,
    run_snapshot,
    run_spawn,
    run_step,
    run_sync,
    run_tick,
)

TOOLS: dict[str, Callable[[Sequence[str]], int]] = {
    "topic": run_topic,
    "service": run_service,
    "node": run_node,
    "param": run_param,
    "action": run_action,
    "schema": run_schema,
    "interface": run_interface,
    "bag": run_bag,
    "scenario": run_scenario,
    "map": run_map,
    "docs": run_docs,
    "campaign": run_campaign,
    "record": run_record,
    "ros2": run_ros2,
    "sync": run_sync,
    "tick": run_tick,
    "step": run_step,
    "score": run_score,
    "snapshot": run_snapshot,
    "restore": run_restore,
    "spawn": run_spawn,
    "sensor": run_sensor,
    "shot": run_shot,
    "clip": run_clip,
    "layout": run_layout,
    "wait": run_wait,
}
"""Name -> function that runs the command with the words behind the name."""
