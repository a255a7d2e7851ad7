"""Keyword arguments of `Simulator`, for type checkers, which then find an unknown name before the program runs.

Each is a field of `Settings`, or a short form, with the types that its check accepts; a test compares the two lists.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, TypedDict


class SimulatorOptions(TypedDict, total=False):
    """All settings, by the names of the fields of `Settings`. Sizes are bytes, or texts such as `16MiB`."""

    host: str
    port: int
    certfile: str | Path | None
    keyfile: str | Path | None
    port_file: str | Path | None
    listen: bool
    page: bool
    open: bool
    page_frame_ancestors: Sequence[str] | str
    attach: Sequence[str] | str
    attach_sockets: Literal["one", "per-topic"]
    scene: bool
    strict_release: bool
    attach_retry: float
    ros2_domain: int | None
    ros2_distro: Literal["humble", "iron", "jazzy", "kilted", "rolling"]
    ros2_namespace: str
    ros2_topics: Sequence[str] | str
    ros2_discovery: Literal["localhost", "multicast"]
    ros2_qos: Sequence[str] | str
    ros2_wait_for_command: bool
    ros2_command_deadline: float
    ros2_without_token: bool
    token: str | None
    allow_origin: Sequence[str] | str
    allow_host: Sequence[str] | str
    allow_publish: Sequence[str] | str
    deny_publish: Sequence[str] | str
    allow_subscribe: Sequence[str] | str
    deny_subscribe: Sequence[str] | str
    allow_service: Sequence[str] | str
    deny_service: Sequence[str] | str
    allow_param: Sequence[str] | str
    deny_param: Sequence[str] | str
    max_clients: int | None
    max_strangers: int
    max_rate: int | None
    max_held: int
    max_calls: int
    world: bool
    scenario: str | Path
    map: str | Path | None
    scenario_path: Sequence[str | Path] | str | Path
    catalogue: str | Path | None
    data_dir: str | Path
    data_quota: int | str | None
    data_quota_files: int | None
    start: Literal["run", "sync"]
    real_time_factor: float
    seed: int
    dynamics: Literal["single-track", "kinematic"]
    creep: bool
    stability_control: bool
    on_collision: Literal["report", "impact"]
    sensor_noise: str
    sensors: str | Path
    weather: Literal["noon", "dusk", "night", "rain", "fog"]
    rain_friction: float
    dressing: bool
    traffic: int
    traffic_wander: bool
    turn_shares: Sequence[float] | str | None
    score: bool
    on_world_failure: Literal["exit", "serve"]
    publishers: Mapping[str, object]
    subscribers: Mapping[str, object]
    services: Mapping[str, object]
    replay_info: bool
    standard_topics: bool
    tf_frames: Literal["map", "map-odom", "odom"]
    cmd_vel: Literal["Twist", "TwistStamped"]
    release: Literal["22.R2", "26.R1"]
    profile: Literal["manual", "field"]
    wheel_angle_unit: Literal["rad", "deg"] | None
    object_size_order: Literal["width-length-height", "length-width-height"] | None
    object_limit: int | None
    object_range: float | None
    object_velocity_unit: Literal["km/h", "m/s"] | None
    stamps: Literal["sim", "wall", "auto"] | None
    start_mode: Literal["external", "keyboard"]
    sync_frames: Literal["lenient", "strict"]
    sync_lease: float | None
    sync_on_loss: Literal["run", "pause", "wait"]
    anyone_may_stop: bool
    ros: Literal[1, 2]
    schema_path: Sequence[str | Path] | str | Path
    strict_types: bool
    service_timeout: float | None
    max_frame_size: int | str
    outbox_burst: int
    outbox_size: int | str
    outbox_limit: int | str
    client_memory: int | str
    memory_budget: int | str | None
    ping_interval: float | None
    ping_timeout: float | None
    compression: bool
    status: bool
    record: str | Path | None
    record_topics: Sequence[str] | str
    log_level: Literal["debug", "info", "warning", "error"]
    log_format: Literal["text", "json"]
    quiet_clients: bool
    config: str | Path | None
    rate: Mapping[str, float] | Sequence[str] | str
