"""All settings.

`Settings` is the only list. Each field has its flag's group, check and help text. The command line, the environment
variables, the keys of the file, `--print-config` and the arguments of `Simulator` (`options.py`) are all made from it
(`loading.py` reads them, `toml_output.py` writes them; `value_types.py` has the checks).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

from rosbridge_sim.shell.config.flag import FlagGroup
from rosbridge_sim.shell.config.value_types import (
    ASSIGNMENTS,
    FOLDER_TYPE,
    FOLDERS,
    FRAMES,
    HOSTS,
    MASTER,
    NAMESPACE,
    NODE_NAME,
    ORIGINS,
    QUALITIES,
    SECRET,
    URLS,
    factor,
    metres,
    or_none,
    period,
    seconds,
    shares,
    size,
    text_of,
    whole_number,
)

if TYPE_CHECKING:  # saves `--help` a tenth of a second of imports
    from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice

_LISTEN = FlagGroup("listening")
_ATTACH = FlagGroup("attaching to another rosbridge")
_ROS1 = FlagGroup("ROS 1")
_ROS2 = FlagGroup("ROS 2")
_ACCESS = FlagGroup("access")
_WORLD = FlagGroup("the world")
_MOCK = FlagGroup("a mock in place of the world")
_NETWORK = FlagGroup("the simulator's topics and services")
_FACE = FlagGroup("MORAI conventions")
_SYNC = FlagGroup("synchronous mode")
_TYPES = FlagGroup("message types")
_WIRE = FlagGroup("connections and messages")
_RECORD = FlagGroup("recording")
_LOG = FlagGroup("log and settings file")

_GIB = 2**30
_DAY = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings of one server, checked. Durations are in seconds, sizes in bytes; None turns something off.

    The field `sync_lease` is the flag `--sync-lease`, the variable `ROSBRIDGE_SIM_SYNC_LEASE` and the key `sync-lease`.
    """

    host: str = _LISTEN.flag(
        "127.0.0.1",
        text_of("a host name or address", "HOST", "str"),
        "address to listen on; 0.0.0.0 is every IPv4 address of this machine",
    )
    port: int = _LISTEN.flag(9090, whole_number(0, 65_535), "TCP port to listen on; 0 takes a free one")
    certfile: str | None = _LISTEN.optional("TLS certificate (PEM); clients then connect to wss://")
    keyfile: str | None = _LISTEN.optional("private key (PEM) of --certfile, if that file does not contain it")

    port_file: str | None = _LISTEN.optional(
        "write the port into this file once the server listens, and remove it at the end; for --port 0"
    )
    listen: bool = _LISTEN.switch(
        "accept clients on --port; with --no-listen the simulator is reachable through --attach only", on=True
    )

    page: bool = _LISTEN.switch("serve a web page at http://HOST:PORT/ that shows and controls the simulation", on=True)
    open: bool = _LISTEN.switch("open that page in a browser at the start")
    page_frame_ancestors: tuple[str, ...] = _LISTEN.several(
        "web pages that may show that page in a frame, such as https://school.example; repeatable; without it none",
        FRAMES,
    )

    attach: tuple[str, ...] = _ATTACH.several(
        "connect to this rosbridge as a client and offer the simulator's topics and services there; repeatable", URLS
    )
    attach_sockets: Literal["one", "per-topic"] = _ATTACH.choice(
        "one",
        "sockets to each bridge: one (and a second one for pictures and clouds), so that the topics of a tick arrive"
        " before its answer, or one for each topic and service",
    )
    scene: bool = _ATTACH.switch("publish the scene there, too, for RViz: /sim/scene/map and /sim/scene/objects")
    strict_release: bool = _ATTACH.switch(
        "stop with exit code 2 if morai_msgs there has other fields than --release, not only log it"
    )
    attach_retry: float = _ATTACH.flag(
        10.0, period(0.1, 3_600.0), "longest wait between two attempts to connect to a bridge"
    )

    ros2_domain: int | None = _ROS2.optional(
        "join this domain of ROS 2 (ROS_DOMAIN_ID) as a node, without an installation of ROS; needs the extra"
        " rosbridge-sim[ros2]",
        or_none(whole_number(0, 232), "none"),
    )
    ros2_through: Literal["auto", "dds", "rclpy"] = _ROS2.choice(
        "auto",
        "library below the node: rclpy of an installed ROS 2 (Jazzy or later), which brings services, actions and"
        " parameters, too; or the DDS library of the extra; auto takes rclpy where it can be imported",
    )
    ros2_distro: Literal["humble", "iron", "jazzy", "kilted", "rolling"] = _ROS2.choice(
        "jazzy", "distribution of the other nodes; humble tells names of nodes in another form"
    )
    ros2_namespace: str = _ROS2.flag(
        "", NAMESPACE, "namespace of the node and of all its topics, such as /sim1; none by default"
    )
    ros2_topics: tuple[str, ...] = _ROS2.several(
        "topics that pass between ROS 2 and this server, such as /tf*; without it all that clients may use; repeatable"
    )
    ros2_services: tuple[str, ...] = _ROS2.several(
        "services and actions of this server that nodes may use, through rclpy; without it all that clients may use,"
        " and with --ros2-discovery multicast only those of clients; repeatable"
    )
    ros2_discovery: Literal["localhost", "multicast"] = _ROS2.choice(
        "localhost",
        "where nodes are looked for: on this machine alone, so that no packet leaves it, or in the whole network",
    )
    ros2_qos: tuple[str, ...] = _ROS2.several(
        "quality of service of this server's publishers whose topics match the pattern, such as '/imu=sensor_data';"
        " the first that matches; default is reliable and 10 messages, transient_local for latched topics; repeatable",
        QUALITIES,
    )
    ros2_wait_for_command: bool = _ROS2.switch(
        "lock step in real time: each frame waits for a command with the header.stamp of its /clock or, without a"
        " header, for one that came after its topics",
    )
    ros2_command_deadline: float = _ROS2.flag(
        1.0, period(0.01, 3_600.0), "longest wait for that command; then the last one holds"
    )
    ros2_without_token: bool = _ROS2.switch("allow --ros2-domain beside --token: DDS asks nobody for a token")

    ros1_master: str | None = _ROS1.optional(
        "join the graph of this master of ROS 1 as a node, without an installation of ROS; env takes ROS_MASTER_URI",
        MASTER,
    )
    ros1_name: str = _ROS1.flag("/rosbridge_sim", NODE_NAME, "name of the node; two nodes cannot have the same")
    ros1_namespace: str = _ROS1.flag(
        "", NAMESPACE, "namespace of the node and of all its topics and services, such as /sim1; none by default"
    )
    ros1_topics: tuple[str, ...] = _ROS1.several(
        "topics that pass between ROS 1 and this server, such as /tf*; without it all that clients may use; repeatable"
    )
    ros1_host: str = _ROS1.flag(
        "127.0.0.1",
        text_of("an address or host name of this machine", "HOST"),
        "address where the node listens; 0.0.0.0 for nodes on other machines, which then reach all without a token",
    )
    ros1_without_token: bool = _ROS1.switch("allow --ros1-master beside --token: ROS 1 asks nobody for a token")

    token: str | None = _ACCESS.optional(
        "token required from clients; set it in the environment or in the settings file to keep it out of the list of"
        " processes",
        SECRET,
    )
    allow_origin: tuple[str, ...] = _ACCESS.several(
        "web pages that may connect, in addition to those of localhost and of the server's own address, such as"
        " https://*.example.org; repeatable",
        ORIGINS,
    )
    allow_host: tuple[str, ...] = _ACCESS.several(
        "host names by which web pages may address the server, and by which /metrics, /map.json, /log.json and"
        " /version are told without a token, in addition to localhost, IP addresses and its own name; repeatable",
        HOSTS,
    )
    allow_publish: tuple[str, ...] = _ACCESS.several(
        "topics that clients may publish, such as /a/*; without it all; repeatable"
    )
    deny_publish: tuple[str, ...] = _ACCESS.several(
        "topics that clients may not publish, even if --allow-publish has them; repeatable"
    )
    allow_subscribe: tuple[str, ...] = _ACCESS.several(
        "topics that clients may subscribe to; without it all; repeatable"
    )
    deny_subscribe: tuple[str, ...] = _ACCESS.several("topics that clients may not subscribe to; repeatable")
    allow_service: tuple[str, ...] = _ACCESS.several(
        "services and actions that clients may call and offer; without it all; /rosapi/* is always allowed; repeatable"
    )
    deny_service: tuple[str, ...] = _ACCESS.several(
        "services and actions that clients may neither call nor offer; repeatable"
    )
    allow_param: tuple[str, ...] = _ACCESS.several(
        "parameters that clients may read and write; without it all; repeatable"
    )
    deny_param: tuple[str, ...] = _ACCESS.several("parameters that clients may neither read nor write; repeatable")
    max_clients: int | None = _ACCESS.flag(1_000, or_none(whole_number(1, 1_000_000), "none"), "most clients at once")
    max_strangers: int = _ACCESS.flag(
        100,
        whole_number(1, 100_000),
        "most connections at once that have not shown the token yet; the oldest one is closed for a new one",
    )
    max_rate: int | None = _ACCESS.optional(
        "most frames a second from one client, after a burst", or_none(whole_number(1, 1_000_000), "none")
    )
    max_held: int = _ACCESS.flag(
        10_000, whole_number(1, 1_000_000), "most subscriptions, advertisements and services of one client"
    )
    max_calls: int = _ACCESS.flag(1_000, whole_number(1, 1_000_000), "most calls and goals of one client in flight")

    mock: str | None = _MOCK.optional(
        "file of a mock (YAML) that is run in place of the world; rosbridge-sim mock run FILE is the same"
    )
    control_port: int | None = _MOCK.optional(
        "second port, on 127.0.0.1, whose clients no fault of the mock touches; 0 takes a free one",
        or_none(whole_number(0, 65_535), "none"),
    )
    hook: str | None = _MOCK.optional(
        "Python function that may change the values of a mock's messages and responses",
        or_none(text_of("a function of a module", "MODULE:FUNCTION"), "none"),
    )

    world: bool = _WORLD.switch("run the simulator; with --no-world this is a rosbridge server alone", on=True)
    scenario: str = _WORLD.flag(
        "demo", text_of("a scenario's name or file", "NAME|FILE"), "scenario that is loaded at the start"
    )
    map: str | None = _WORLD.optional(
        "map that replaces the map of every scenario",
        or_none(text_of("a map's name, folder or .xodr file", "NAME|DIR|FILE"), "none"),
    )
    signal_plan: str | None = _WORLD.optional(
        "phases of the traffic lights of the map, JSON; see the guide Roads in OpenDRIVE"
    )
    scenario_path: tuple[str, ...] = _WORLD.several("folder with scenarios that clients may load; repeatable", FOLDERS)
    param: tuple[str, ...] = _WORLD.several(
        "value of a parameter of the scenario, of a file of OpenSCENARIO (*.xosc); repeatable", ASSIGNMENTS
    )
    ego_entity: str | None = _WORLD.optional(
        "entity of a *.xosc that is the ego; without it one named Ego, hero or ego_vehicle, else the first vehicle",
        or_none(text_of("the name of an entity", "NAME", "str"), "none"),
    )
    ego: Literal["program", "story"] = _WORLD.choice(
        "program", "who drives the ego of a *.xosc: the user's program, or what the file asks for"
    )
    lenient: bool = _WORLD.switch("leave out what a *.xosc asks for and is not supported, and run the rest")
    catalogue: str | None = _WORLD.optional(
        "your table of models, *.toml or *.csv, searched before the built-in one; columns: DataID, name, class,"
        " length, width, height, wheelbase, rear_overhang [m], max_steer [deg], mass [kg]"
    )
    data_dir: str = _WORLD.flag(
        "SaveFile",
        FOLDER_TYPE,
        "folder of saved sensor data, network settings and recordings to replay; created when it is needed",
    )
    data_quota: int | None = _WORLD.flag(
        10 * _GIB,
        or_none(size(1024, 2**20 * _GIB), "none"),
        "most bytes in --data-dir; a client's request to save beyond that is refused",
    )
    data_quota_files: int | None = _WORLD.flag(
        200_000,
        or_none(whole_number(1, 1_000_000_000), "none"),
        "most files and folders in --data-dir, in the same way",
    )
    start: Literal["run", "sync"] = _WORLD.choice(
        "run", "at the start, run in real time, or stand at frame 0 until a client starts synchronous mode"
    )
    real_time_factor: float = _WORLD.flag(
        1.0,
        factor(0.1, 20.0),
        "simulated seconds in a second while real time moves the world; 0 is as fast as possible",
    )
    seed: int = _WORLD.flag(0, whole_number(0, 2**32 - 1), "random seed of the simulation, or of the mock")
    dynamics: Literal["single-track", "kinematic"] = _WORLD.choice(
        "single-track",
        "model of the egos: tyres that slip, lags of the pedals and a body that leans, or wheels that roll where they"
        " point",
    )
    creep: bool = _WORLD.switch(
        "without pedals, egos creep in D and R and roll on slopes; only with --dynamics single-track"
    )
    stability_control: bool = _WORLD.switch(
        "egos keep grip for the bend while they brake, and are braked against a spin; only with --dynamics"
        " single-track",
        on=True,
    )
    on_collision: Literal["report", "impact"] = _WORLD.choice(
        "report",
        "report collisions without an effect on motion, or change the motion of egos and of vehicles on lanes, too",
    )
    sensor_noise: str = _WORLD.flag(
        "none",
        text_of("none, typical or a file", "none|typical|FILE"),
        "errors of the sensors: none, those of usual units, or those of a *.json file",
    )
    sensors: str = _WORLD.flag(
        "none",
        text_of("none, camera, lidar, teaching, lane-detection, calibration, fisheye, all or a file", "NAME|FILE"),
        "cameras, lidars and radars of each ego: none, camera, lidar, teaching, lane-detection, calibration, fisheye,"
        " all, a *.toml file, or a *.json file of MORAI's SaveFile/Sensor; all but radars need the extra"
        " rosbridge-sim[sensors]",
    )
    weather: Literal["noon", "dusk", "night", "rain", "fog"] = _WORLD.choice(
        "noon", "light and air of what cameras see; rain and fog take echoes of lidars, too"
    )
    rain_friction: float = _WORLD.flag(
        0.0,
        factor(0.1, 1.0),
        "friction of the ground in the weather rain, relative to a dry one: 0.7 is wet asphalt; 0: rain changes none;"
        " only with --dynamics single-track",
    )
    dressing: bool = _WORLD.switch(
        "cameras and lidars see buildings, trees and posts beside the roads; off: roads and lights alone", on=True
    )
    traffic: int = _WORLD.flag(
        0,
        whole_number(0, 10_000),
        "vehicles that drive on the lanes besides those of the scenario: as many as fit, and kept there",
    )
    traffic_wander: bool = _WORLD.switch(
        "vehicles of --traffic wander a little within their lane, as drivers do; off: they keep to its line", on=True
    )
    turn_shares: str | None = _WORLD.optional(
        "how often drivers without a route turn, for example 1,2,1 for half of them straight on; none: all lanes that"
        " follow are equally likely",
        or_none(shares("LEFT,STRAIGHT,RIGHT"), "none"),
    )
    score: bool = _WORLD.switch(
        "keep scores of the egos from frame 0 on, not only after the first request for /sim/score"
    )
    on_world_failure: Literal["exit", "serve"] = _WORLD.choice(
        "exit",
        "after an internal error in a step of the world, end with code 1, or go on serving clients without the world",
    )

    publishers: Mapping[str, "InterfaceChoice"] = _NETWORK.table(
        "publishers", "topics that the simulator publishes: name, rate [Hz, at most 120], on or off"
    )
    subscribers: Mapping[str, "InterfaceChoice"] = _NETWORK.table(
        "subscribers", "topics that the simulator subscribes to: name, on or off"
    )
    services: Mapping[str, "InterfaceChoice"] = _NETWORK.table(
        "services", "services that the simulator offers: name, on or off"
    )

    replay_info: bool = _NETWORK.switch(
        "publish /ReplayInfo_topic to bridges and --record, too; clients that subscribe always get it"
    )
    standard_topics: bool = _NETWORK.switch(
        "publish /odom, /fix and /robot_description and take /cmd_vel and /ackermann_cmd, for programs without"
        " morai_msgs; always with --ros2-domain",
    )
    tf_frames: Literal["map", "map-odom", "odom"] = _NETWORK.choice(
        "map",
        "frames above base_link on /tf, from the one without a parent: map; map-odom as in REP 105, for Nav2; odom if"
        " your own localization publishes map to odom. /odom has the pose in the frame just above base_link",
    )
    cmd_vel: Literal["Twist", "TwistStamped"] = _NETWORK.choice(
        "Twist",
        "type of /cmd_vel in geometry_msgs; TwistStamped for Nav2 with enable_stamped_cmd_vel, as it is since Kilted",
    )

    release: Literal["22.R2", "26.R1"] = _FACE.choice("22.R2", "MORAI SIM release whose message definitions are used")
    profile: Literal["manual", "field"] = _FACE.choice(
        "manual", "convention to follow where MORAI's manual and existing client code disagree"
    )
    wheel_angle_unit: Literal["rad", "deg"] | None = _FACE.choice(None, "unit of the ego's wheel_angle", none="profile")
    object_size_order: Literal["width-length-height", "length-width-height"] | None = _FACE.choice(
        None, "meaning of x, y, z of an object's size", none="profile"
    )
    object_limit: int | None = _FACE.optional(
        "most objects that are published, the nearest ones; 0 is all", or_none(whole_number(0, 1_000_000), "profile")
    )
    object_range: float | None = _FACE.optional(
        "only objects within this distance of the ego are published; none or 0 is all", metres(1_000_000)
    )
    object_velocity_unit: Literal["km/h", "m/s"] | None = _FACE.choice(
        None, "unit of objects' velocity", none="profile"
    )
    stamps: Literal["sim", "wall", "auto"] | None = _FACE.choice(
        None,
        "time in headers, /clock and tf: simulated time, time of day, or (auto) as /use_sim_time of the first bridge"
        " says; the default is sim for serve and auto for attach",
        none="default",
    )
    start_mode: Literal["external", "keyboard"] = _FACE.choice(
        "external", "control mode of the ego at the start; with external, /ctrl_cmd moves it"
    )

    sync_frames: Literal["lenient", "strict"] = _SYNC.choice(
        "lenient", "frames that a tick may name: any, or only the next one"
    )
    sync_lease: float | None = _SYNC.optional(
        "seconds without a call after which the master is considered lost; a closed connection always is", seconds(_DAY)
    )
    sync_on_loss: Literal["run", "pause", "wait"] = _SYNC.choice(
        "run", "after the master is lost, run in real time, pause, or wait for a new master"
    )
    anyone_may_stop: bool = _SYNC.switch("let any client stop synchronous mode, not only its master")

    ros: Literal[1, 2] = cast(
        "Literal[1, 2]",
        _TYPES.flag(1, whole_number(1, 2, "1|2"), "ROS generation of type names, times and serialised bytes"),
    )
    schema_path: tuple[str, ...] = _TYPES.several(
        "folder with ROS packages (PACKAGE/msg/*.msg) to read; repeatable", FOLDERS
    )
    strict_types: bool = _TYPES.switch(
        "refuse types of unknown packages; otherwise their messages are relayed unchecked"
    )

    service_timeout: float | None = _WIRE.optional(
        "longest wait for the answer of a client's service, for calls that name no timeout", seconds(_DAY)
    )
    max_frame_size: int = _WIRE.flag(
        16 * 2**20, size(1024, _GIB), "longest frame; a longer one closes the connection (code 1009)"
    )
    outbox_burst: int = _WIRE.flag(
        100,
        whole_number(1, 1_000_000),
        "messages of each topic kept for a client that reads too slowly, the newest ones",
    )
    outbox_size: int = _WIRE.flag(
        4 * 2**20, size(1024, 4 * _GIB), "bytes that may wait for a client before its oldest topic messages are dropped"
    )
    outbox_limit: int = _WIRE.flag(
        64 * 2**20, size(1024, 16 * _GIB), "bytes that may wait for a client before it is closed (code 1008)"
    )
    client_memory: int = _WIRE.flag(
        256 * 2**20,
        size(2**20, 64 * _GIB),
        "most memory held for one client: throttle queues, latched messages, calls in flight, parts of frames",
    )
    memory_budget: int | None = _WIRE.optional(
        "most memory held for all clients together; beyond it the client that holds most is closed; auto is half of"
        " the memory of the machine or container",
        or_none(size(2**20, 1024 * _GIB), "auto"),
    )
    ping_interval: float | None = _WIRE.flag(20.0, seconds(_DAY), "seconds between two pings")
    ping_timeout: float | None = _WIRE.flag(
        20.0, seconds(_DAY), "seconds after which an unanswered ping closes the connection"
    )
    compression: bool = _WIRE.switch("compress messages (permessage-deflate) for clients that offer it")
    status: bool = _WIRE.switch("send status frames to clients", on=True)

    record: str | None = _RECORD.optional(
        "record into this bag: NAME.bag is ROS 1, NAME.mcap ROS 2, any other name a folder of ROS 2"
    )
    record_topics: tuple[str, ...] = _RECORD.several(
        "topics to record, such as /a/*; without it those of the simulator, its commands included; repeatable"
    )

    log_level: Literal["debug", "info", "warning", "error"] = _LOG.choice("info", "lowest level of log lines on stderr")
    log_format: Literal["text", "json"] = _LOG.choice(
        "text", "lines for people, or one JSON object a line with the date in UTC"
    )
    quiet_clients: bool = _LOG.switch("leave mistakes of clients out of the log")
    config: str | None = _LOG.optional(
        "settings file; keys are the names of flags, paths are relative to its folder",
        text_of("a TOML file", "FILE.toml"),
    )
