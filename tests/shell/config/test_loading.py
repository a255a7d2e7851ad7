"""Flags, environment, file and defaults: precedence and errors."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import PREFIX
from rosbridge_sim.shell.assembly import mistakes_of_items
from rosbridge_sim.shell.config.flag_table import FIELDS, FLAGS, SHORT_FORMS
from rosbridge_sim.shell.config.loading import check_options, read_settings, strange_variables
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.settings_file import looks_like_path, read_network
from rosbridge_sim.shell.config.toml_output import format_config
from rosbridge_sim.shell.config.value_types import FILE, FOLDER_TYPE, FOLDERS, SWITCH
from rosbridge_sim.simulator.bus.interface_registry import ListedInterface
from rosbridge_sim.simulator.bus.network_settings import InterfaceChoice, InterfaceKind, NetworkSettings

OTHER: dict[str, object] = {
    "mock": "/robots/robot.yaml",
    "control_port": 9091,
    "hook": "my_module:my_function",
    "host": "::1",
    "port": 8000,
    "client_memory": 32 * 2**20,
    "memory_budget": 2**30,
    "ros": 2,
    "real_time_factor": 2.5,
    "certfile": "a.pem",
    "keyfile": "b c.pem",
    "token": "s3cret+/=",
    "allow_origin": ("https://*.example.org", "http://[::1]:8080"),
    "allow_host": ("sim", "*.lab.example"),
    "allow_publish": ("/a/*", "b"),
    "deny_publish": ("/[cd]",),
    "allow_subscribe": ("*",),
    "deny_subscribe": ("/e?",),
    "allow_service": ("/f",),
    "deny_service": ("/rosapi/set_param", "/g"),
    "allow_param": ("/h/*",),
    "deny_param": ("/i",),
    "max_clients": None,
    "max_strangers": 7,
    "max_rate": 100,
    "max_held": 5,
    "max_calls": 6,
    "world": False,
    "scenario": "loop",
    "map": "track",
    "scenario_path": ("a", "b c"),
    "catalogue": "cars.toml",
    "signal_plan": "plan.json",
    "param": ("speed=3", "name=a b"),
    "ego_entity": "Ego 2",
    "ego": "story",
    "lenient": True,
    "data_dir": "data",
    "data_quota": 2**21,
    "data_quota_files": None,
    "start": "sync",
    "weather": "fog",
    "rain_friction": 0.7,
    "dressing": False,
    "seed": 3,
    "on_world_failure": "serve",
    "publishers": {"/Ego_topic": InterfaceChoice("/car", is_on=True, rate=10.0), "/tf": InterfaceChoice(rate=0.5)},
    "subscribers": {"/ctrl_cmd": InterfaceChoice(is_on=False)},
    "services": {"/SyncModeCmd": InterfaceChoice('/a"b')},
    "profile": "field",
    "wheel_angle_unit": "deg",
    "object_size_order": "length-width-height",
    "object_limit": 20,
    "object_range": 150.0,
    "object_velocity_unit": "m/s",
    "start_mode": "keyboard",
    "stamps": "wall",
    "replay_info": True,
    "dynamics": "kinematic",
    "creep": True,
    "stability_control": False,
    "on_collision": "impact",
    "sensor_noise": "typical",
    "sensors": "teaching",
    "traffic": 50,
    "traffic_wander": False,
    "turn_shares": "1,2.5,0",
    "score": True,
    "sync_frames": "strict",
    "sync_lease": 2.5,
    "sync_on_loss": "wait",
    "anyone_may_stop": True,
    "schema_path": ("x", "y"),
    "strict_types": True,
    "quiet_clients": True,
    "listen": False,
    "attach": ("ws://a:9090", "wss://b/?token=abc"),
    "attach_sockets": "per-topic",
    "scene": True,
    "strict_release": True,
    "attach_retry": 2.5,
    "standard_topics": True,
    "tf_frames": "map-odom",
    "cmd_vel": "TwistStamped",
    "ros1_master": "http://robot:11311",
    "ros1_name": "/sim",
    "ros1_namespace": "/sim1",
    "ros1_topics": ("/tf*", "/imu"),
    "ros1_host": "0.0.0.0",  # noqa: S104 - nothing listens
    "ros1_without_token": True,
    "ros2_domain": 7,
    "ros2_through": "rclpy",
    "ros2_services": ("/SyncMode*", "/sim/*"),
    "ros2_distro": "humble",
    "ros2_namespace": "/sim1",
    "ros2_topics": ("/tf*", "/imu"),
    "ros2_discovery": "multicast",
    "ros2_qos": ("/imu=sensor_data", "/map*=latched"),
    "ros2_wait_for_command": True,
    "ros2_command_deadline": 2.5,
    "ros2_without_token": True,
    "service_timeout": 3.0,
    "max_frame_size": 2**20,
    "outbox_burst": 7,
    "outbox_size": 2**20,
    "outbox_limit": 2**21,
    "ping_interval": None,
    "ping_timeout": 1.0,
    "compression": True,
    "status": False,
    "record": "/bags/drive.bag",
    "record_topics": ("/clock", "/Ego*"),
    "log_level": "debug",
    "log_format": "json",
    "port_file": "/run/port.txt",
    "page": False,
    "open": True,
    "page_frame_ancestors": ("https://*.example.org", "http://[::1]:8080"),
}
"""A value other than the default for every setting that has one."""

NOT_PRINTED = {"token": None, "attach": ("ws://a:9090", "wss://b")}
"""What is left of values with secrets in them when they are printed."""


def as_words(key: str, value: object) -> list[str]:
    """The words of a command line that set it."""
    if isinstance(value, bool):
        return [f"--{key}" if value else f"--no-{key}"]
    if isinstance(value, tuple):
        return [word for one in value for word in (f"--{key}", one)]
    return [f"--{key}", "none" if value is None else str(value)]


def as_variable(key: str, value: object) -> str:
    if isinstance(value, tuple):
        return FLAGS[key].kind.separator.join(value)
    return "none" if value is None else str(value)


def mistake(argv: list[str], environ: dict[str, str] | None = None) -> str:
    with pytest.raises(SettingError) as caught:
        read_settings(argv, environ or {}, find_more=mistakes_of_items)
    text = str(caught.value)
    if "--config" not in argv:
        assert "\n" not in text
    return text


def mistake_in(tmp_path: Path, text: str | bytes) -> str:
    """What is said of a file, with its folder left out."""
    path = tmp_path / "s.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return mistake(["--config", str(path)]).replace(str(tmp_path) + os.sep, "")


def test_test_values_cover_every_setting() -> None:
    only_one_value = {"release", "config"}
    assert OTHER.keys() | only_one_value == {field.name for field in FIELDS.values()}
    defaults = Settings()
    assert all(getattr(defaults, name) != value for name, value in OTHER.items())


# Places


@pytest.mark.parametrize("name", OTHER)
def test_every_setting_has_a_flag_a_variable_and_an_option(name: str) -> None:
    key = name.replace("_", "-")
    value = OTHER[name]
    quiet = {"outbox_size": 1024} if name == "outbox_limit" else {}  # which must not be larger
    wanted = check_options({name: value, **quiet})
    assert getattr(wanted, name) == value

    if not FLAGS[key].kind.is_table:  # too much for a flag or a variable
        words = as_words(key, value) + (["--outbox-size", "1KiB"] if quiet else [])
        assert read_settings(words, {}) == wanted

        variables = {PREFIX + name.upper(): as_variable(key, value)}
        assert read_settings([], variables | ({PREFIX + "OUTBOX_SIZE": "1024"} if quiet else {})) == wanted


def test_every_setting_has_a_key_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text(format_config(check_options(OTHER), []))
    from_file = read_settings(["--config", str(file)], {})
    for name, value in OTHER.items():
        kind = FLAGS[name.replace("_", "-")].kind
        if kind in (FOLDERS, FOLDER_TYPE, FILE):  # paths are taken from the file's folder
            paths = value if isinstance(value, tuple) else (value,)
            beside = tuple(str(tmp_path / str(path)) for path in paths)
            value = beside if kind is FOLDERS else beside[0]  # noqa: PLW2901 - as the file has it
        assert getattr(from_file, name) == NOT_PRINTED.get(name, value), name


def test_flag_beats_environment_beats_file_beats_default(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('port = 1\nseed = 1\nstart = "sync"\n')
    variables = {"ROSBRIDGE_SIM_PORT": "2", "ROSBRIDGE_SIM_SEED": "2", "ROSBRIDGE_SIM_CONFIG": str(file)}
    settings = read_settings(["--port", "3"], variables)
    assert (settings.port, settings.seed, settings.start, settings.host) == (3, 2, "sync", "127.0.0.1")


def test_config_flag_overrides_the_variable(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text("port = 1\n")
    assert read_settings(["--config", str(file)], {"ROSBRIDGE_SIM_CONFIG": "/nowhere"}).port == 1


def test_list_comes_from_one_source_only() -> None:
    assert read_settings(["--schema-path", "a"], {"ROSBRIDGE_SIM_SCHEMA_PATH": "b"}).schema_path == ("a",)


@pytest.mark.parametrize("key", [key for key in FIELDS if FLAGS[key].kind is SWITCH])
def test_no_form_turns_a_switch_off_in_every_source(key: str, tmp_path: Path) -> None:
    name = FIELDS[key].name
    file = tmp_path / "s.toml"
    file.write_text(f"no-{key} = true\n")
    for settings in (
        read_settings([f"--no-{key}"], {}),
        read_settings([], {f"ROSBRIDGE_SIM_NO_{name.upper()}": "1"}),
        read_settings(["--config", str(file)], {}),
    ):
        assert getattr(settings, name) is False
    assert getattr(read_settings([f"--{key}"], {f"ROSBRIDGE_SIM_NO_{name.upper()}": "1"}), name) is True


@pytest.mark.parametrize("text", ["", " "])
def test_empty_token_variable_is_refused(text: str) -> None:
    with pytest.raises(SettingError, match="ROSBRIDGE_SIM_TOKEN: expected a token, or none; got an empty text"):
        read_settings([], {"ROSBRIDGE_SIM_TOKEN": text})
    assert read_settings([], {"ROSBRIDGE_SIM_TOKEN": "none"}).token is None


def test_empty_token_flag_is_refused_as_an_empty_text() -> None:
    with pytest.raises(SettingError, match=r"--token: expected .*, or none; got an empty text"):
        read_settings(["--token", ""], {})


def test_empty_variable_counts_as_absent() -> None:
    assert read_settings([], {"ROSBRIDGE_SIM_PORT": "", "ROSBRIDGE_SIM_SCHEMA_PATH": " "}) == Settings()


def test_kubernetes_port_variable_is_ignored() -> None:
    assert read_settings([], {"ROSBRIDGE_SIM_PORT": "tcp://10.0.0.1:9090"}).port == 9090


def test_config_file_may_use_underscores_and_a_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_bytes(b'\xef\xbb\xbfsync_lease = 3\r\n[services]\r\n"sim/reset" = {on=false}\r\n')
    settings = read_settings(["--config", str(file)], {})
    assert settings.sync_lease == 3.0
    assert settings.services == {"/sim/reset": InterfaceChoice(is_on=False)}


def test_paths_in_a_file_are_relative_to_its_folder(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('schema-path = ["msgs", "/abs"]\nscenario = "mine.json"\nmap = "./city"\ndata-dir = "data"\n')
    settings = read_settings(["--config", str(file)], {})
    assert settings.schema_path == (str(tmp_path / "msgs"), "/abs")
    assert settings.scenario == str(tmp_path / "mine.json")
    assert settings.map == str(tmp_path / "city")
    assert settings.data_dir == str(tmp_path / "data")


def test_built_in_names_in_a_file_stay_names(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('scenario = "demo"\nmap = "track"\n')
    settings = read_settings(["--config", str(file)], {})
    assert (settings.scenario, settings.map) == ("demo", "track")


def test_printed_config_gives_the_settings_back(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    paths = {
        "scenario_path": ("/a",),
        "data_dir": "/d",
        "catalogue": "/m.csv",
        "signal_plan": "/p.json",
        "schema_path": ('/x"\\\n',),
        "certfile": "/c.pem",
        "keyfile": "/k.pem",
    }
    file.write_text(format_config(check_options({**OTHER, **paths}), []))
    assert read_settings(["--config", str(file)], {}) == check_options(
        {**OTHER, **paths, **NOT_PRINTED, "config": str(file)}
    )


def test_printed_config_lists_all_interfaces_then_other_entries(tmp_path: Path) -> None:
    items = [
        ListedInterface(
            InterfaceKind.PUBLISHER, "/Ego_topic", "morai_msgs/EgoVehicleStatus", "/car", is_on=True, rate=12.5
        ),
        ListedInterface(
            InterfaceKind.PUBLISHER, "/tf_static", "tf2_msgs/TFMessage", "/tf_static", is_on=False, rate=None
        ),
        ListedInterface(InterfaceKind.SERVICE, "/sim/reset", "std_srvs/Trigger", "/sim/reset", is_on=True, rate=None),
    ]
    own = {"/Ego_topic": {"name": "/car"}, "/Ego-2/Ego_topic": {"rate": 5}}
    text = format_config(check_options({"publishers": own}), items)
    tables = [line for line in text[text.index("[publishers]") :].splitlines() if line and line[0] != "#"]
    assert tables == [
        "[publishers]",
        '"/Ego_topic" = { name = "/car", rate = 12.5, on = true }',
        '"/tf_static" = { name = "/tf_static", on = false }',
        '"/Ego-2/Ego_topic" = { rate = 5 }',
        "[subscribers]",
        "[services]",
        '"/sim/reset" = { name = "/sim/reset", on = true }',
    ]
    file = tmp_path / "s.toml"
    file.write_text(text)
    again = format_config(read_settings(["--config", str(file)], {}), [])
    assert again.endswith(text[text.index("[publishers]") :])


def test_network_settings_may_stand_in_a_whole_settings_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "n.toml"
    file.write_text('port = 1\nno-world = true\n[publishers]\n"tf" = { rate = 5 }\n')
    with caplog.at_level("INFO"):
        assert read_network(file) == NetworkSettings(publishers={"/tf": InterfaceChoice(rate=5.0)})
    assert caplog.messages == [f"{file}: ignored keys that are not network settings: port, world"]
    file.write_text("[publisher]\n")
    with pytest.raises(SettingError, match=r"n.toml:1: publisher: no such setting \(did you mean publishers\?\)"):
        read_network(file)
    file.write_text('[services]\n"/x y" = {}\n')
    with pytest.raises(
        SettingError, match=r'n.toml:2: services."/x y": expected the name of a topic or service, without blanks'
    ):
        read_network(file)


def test_invalid_token_is_not_shown() -> None:
    said = "expected printable ASCII without blanks, or none; got something else"
    assert mistake(["--token", "my secret"]) == f"--token: {said}"
    assert mistake([], {"ROSBRIDGE_SIM_TOKEN": "geheimniß"}) == f"ROSBRIDGE_SIM_TOKEN: {said}"
    assert "geheim" not in repr(check_options({"token": "geheim"}))


def test_printed_config_names_the_place_of_secrets_and_shows_none(tmp_path: Path) -> None:
    urls = ["ws://a:9090", "wss://me:geheim@b/x?token=geheim"]
    text = format_config(check_options({"token": "geheim", "attach": urls}), [])
    assert "geheim" not in text
    assert "# token is set, and is not printed: write it here, or into ROSBRIDGE_SIM_TOKEN\n" in text
    assert '# a token or a password in a URL is not printed: add it to the URL here\nattach = ["ws://a:9090"' in text
    (tmp_path / "s.toml").write_text(text.replace("# token is set", 'token = "geheim"\n# token is set'))
    assert read_settings(["--config", str(tmp_path / "s.toml")], {}).token == "geheim"  # noqa: S105 - a test's own
    assert "not printed" not in format_config(check_options({"attach": "ws://a/x"}), [])


@pytest.mark.parametrize(
    "words",
    [
        ["--tokn", "geheim"],
        ["--tokn=geheim"],
        ["token=geheim"],
        ["ws://h/?token=geheim"],
        ["--port", "ws://me:geheim@h"],
        ["--ping-interval", "?token=geheim"],
        ["--allow-publish", "token=geheim x"],
    ],
)
def test_error_next_to_a_token_does_not_show_the_token(words: list[str]) -> None:
    assert "geheim" not in mistake(words)


def test_attach_takes_urls_and_flags_in_any_order_and_does_not_listen() -> None:
    settings = read_settings(["a", "--seed", "3", "b:9091", "--start", "sync"], {}, command="attach")
    assert settings == check_options(
        {"attach": ["ws://a:9090", "ws://b:9091"], "seed": 3, "start": "sync", "listen": False}
    )


def test_command_line_urls_override_environment_and_file(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('attach = ["ws://one:1", "ws://two:2"]\n')
    config = ["--config", str(file)]
    assert read_settings(config, {}, command="attach").attach == ("ws://one:1", "ws://two:2")
    variables = {"ROSBRIDGE_SIM_ATTACH": "three:3,four"}
    assert read_settings(config, variables, command="attach").attach == ("ws://three:3", "ws://four:9090")
    assert read_settings([*config, "five"], variables, command="attach").attach == ("ws://five:9090",)


@pytest.mark.parametrize("flag", ["--port", "--host", "--token", "--max-clients", "--attach"])
def test_attach_has_no_server_flags(flag: str) -> None:
    with pytest.raises(SettingError, match=f"{flag}: is a flag of serve"):
        read_settings(["a", flag, "1"], {}, command="attach")


def test_invalid_url_is_shown_without_its_token() -> None:
    text = "--attach: expected URLs of rosbridges, each once, such as ws://192.168.0.5:9090; got "
    assert mistake(["--attach", "ws://h:x/?token=geheim"]) == f"{text}['ws://h:x/?...']"
    assert mistake(["--attach", "a", "--attach", "a"]) == f"{text}['a', 'a']"
    assert "geheim" not in repr(check_options({"attach": "ws://h/?token=geheim"}))


def test_help_shows_unit_variable_and_key_of_every_flag(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        read_settings(["--help"], {})
    assert not caught.value.code
    text = capsys.readouterr().out
    for key in [*FIELDS, *SHORT_FORMS]:
        assert f"--{key}" in text or f"[{key}]" in text
        assert FLAGS[key].group in text
    assert "SECONDS" in text
    assert "ROSBRIDGE_SIM_SYNC_LEASE" in text
    assert "SUPPRESS" not in text


# Mistakes


@pytest.mark.parametrize(
    ("argv", "text"),
    [
        (["--prot", "1"], "no such flag: --prot (did you mean --port?); --help lists them all"),
        (["--prot=1"], "no such flag: --prot (did you mean --port?); --help lists them all"),
        (["--zzz"], "no such flag: --zzz; --help lists them all"),
        (["-p", "1"], "no such flag: -p; --help lists them all"),
        (["--sync"], "no such flag: --sync; --help lists them all"),
        (["--no-port"], "no such flag: --no-port (did you mean --port?); --help lists them all"),
        (["demo"], "expected flags; got 'demo'"),
        (["--port"], "--port: expected one argument"),
        (["--port", "abc"], "--port: expected a whole number from 0 to 65,535; got 'abc'"),
        (["--port", "-1"], "--port: expected a whole number from 0 to 65,535; got '-1'"),
        (["--start", "later"], "--start: expected run or sync; got 'later'"),
        (["--release", "21.R1"], "--release: expected 22.R2 or 26.R1; got '21.R1'"),
        (["--sync-lease", "soon"], "--sync-lease: expected seconds up to 86,400, or none; got 'soon'"),
        (["--rate", "x"], "--rate: expected TOPIC=HZ with at most 120 Hz, such as /Ego_topic=10; got ['x']"),
        (["--outbox-limit", "2KiB"], "outbox-limit: expected at least outbox-size, 4MiB; got 2KiB"),
    ],
)
def test_command_line_error_is_one_line(argv: list[str], text: str) -> None:
    assert mistake(argv) == text


def test_environment_error_names_the_variable() -> None:
    text = mistake([], {"ROSBRIDGE_SIM_SYNC_LEASE": "abc"})
    assert text == "ROSBRIDGE_SIM_SYNC_LEASE: expected seconds up to 86,400, or none; got 'abc'"


def test_rate_flag_overrides_the_file_for_one_publisher(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('[publishers]\n"/tf" = { name = "/t", rate = 5 }\n"/clock" = { rate = 6 }\n')
    config = ["--config", str(file)]
    both = {"/tf": InterfaceChoice("/t", rate=7.0), "/clock": InterfaceChoice(rate=6.0)}
    assert read_settings([*config, "--rate", "tf=7"], {}).publishers == both
    assert read_settings(config, {"ROSBRIDGE_SIM_RATE": "/tf=7"}).publishers == both
    assert check_options({"config": str(file), "rate": {"/tf": 7}}).publishers == both
    choices = read_settings([*config, "--rate", "Ego_topic=7"], {}).publishers
    assert choices == {
        "/tf": InterfaceChoice("/t", rate=5.0),
        "/clock": InterfaceChoice(rate=6.0),
        "/Ego_topic": InterfaceChoice(rate=7.0),
    }
    assert choices["/Ego_topic"].where == "--rate /Ego_topic=7"
    assert choices["/tf"].where == f'{file}:2: publishers."/tf"'


def test_contradicting_switches_in_one_source_are_an_error() -> None:
    text = mistake([], {"ROSBRIDGE_SIM_WORLD": "1", "ROSBRIDGE_SIM_NO_WORLD": "1"})
    assert text == "ROSBRIDGE_SIM_NO_WORLD: world and no-world contradict each other"
    assert not read_settings([], {"ROSBRIDGE_SIM_WORLD": "0", "ROSBRIDGE_SIM_NO_WORLD": "1"}).world


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("port = 1\nhost\n", "s.toml:2:5: not valid TOML: Expected '=' after a key in a key/value pair"),
        ('host = "a', "s.toml: not valid TOML: Unterminated string at its end"),
        ("\n\nprot = 1\n", "s.toml:3: prot: no such setting (did you mean port?)"),
        ("no-port = 1\n", "s.toml:1: no-port: no such setting (did you mean port?)"),
        ("[room]\nport = 1\n", "s.toml:1: room: no such setting"),
        ('# x\n"port" = "y"\n', "s.toml:2: port: expected a whole number from 0 to 65,535; got 'y'"),
        ("port = 1979-05-27\n", None),
        ("world = 3\n", "s.toml:1: world: expected true or false; got 3"),
        (
            "[rate]\nclock = 5\n",
            's.toml:1: rate: expected [publishers] with lines such as "/Ego_topic" = { rate = 10 }',
        ),
        (
            '[publishers]\n"/clock" = { rate = 500 }\n',
            's.toml:2: publishers."/clock".rate: expected more than 0 and at most 120 Hz, got 500',
        ),
        (
            '[services."/sim/reset"]\non = true\n\nnam = "/x"\n',
            's.toml:4: services."/sim/reset".nam: expected one of name, on (did you mean name?)',
        ),
        ("subscribers = 3\n", 's.toml:1: subscribers: expected a table such as "/NAME" = { on = true }, got 3'),
        ("[host]\nx = 1\n", "s.toml:1: host: expected a host name or address; got {'x': 1}"),
        ('config = "b.toml"\n', "s.toml:1: config: a settings file cannot name another settings file"),
        ("world = true\nno-world = true\n", "s.toml:2: no-world: world and no-world contradict each other"),
        (b"# \xe9\nport = 1\n# \xff", "s.toml:1: expected UTF-8 text"),
        ("a = " + "[" * 100_000, "s.toml: nested too deeply"),
        (b"#" * (2**20 + 1), "s.toml: expected a settings file; it is longer than 1MiB"),
    ],
)
def test_file_error_is_one_line_with_its_place(tmp_path: Path, text: str | bytes, said: str | None) -> None:
    line = mistake_in(tmp_path, text)
    assert line.startswith("s.toml")
    if said is not None:
        assert line == said


def test_missing_file_is_named() -> None:
    assert mistake(["--config", "/nowhere/s.toml"]) == "/nowhere/s.toml: cannot be read: No such file or directory"
    assert "directory" in mistake(["--config", "/"])


def test_long_value_is_shortened() -> None:
    assert len(mistake(["--port", "9" * 10_000])) < 200


# Options of a Simulator


def test_unknown_option_is_named() -> None:
    with pytest.raises(SettingError, match=r"no such option: prot \(did you mean port\?\)"):
        check_options({"prot": 0})


def test_option_with_an_invalid_value_is_named() -> None:
    with pytest.raises(SettingError, match="port: expected a whole number"):
        check_options({"port": "x"})


def test_options_ignore_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROSBRIDGE_SIM_PORT", "1")
    assert check_options({}).port == 9090


def test_none_is_accepted_only_for_optional_settings() -> None:
    assert check_options({"map": None, "sync_lease": None, "object_limit": None, "ping_interval": None}).map is None
    with pytest.raises(SettingError):
        check_options({"port": None})


# Beside the settings


def test_misspelt_variable_is_reported_and_an_unrelated_one_is_not() -> None:
    lines = strange_variables({"ROSBRIDGE_SIM_SYNC_LAESE": "1", "ROSBRIDGE_SIM_SERVICE_HOST": "x", "PATH": "/bin"})
    assert lines == [
        "the environment variable ROSBRIDGE_SIM_SYNC_LAESE means nothing here (did you mean ROSBRIDGE_SIM_SYNC_LEASE?)"
    ]


def test_path_like_values_are_recognised() -> None:
    assert [looks_like_path(name) for name in ("demo", "demo.json", "./demo", "a/b", ".")] == [
        False, True, True, True, True,
    ]  # fmt: skip


def test_all_errors_of_a_file_are_reported_with_their_lines(tmp_path: Path) -> None:
    text = """\
prot = 1
host = 3
start = "later"
port = 9000
rate = 3
[publishers]
"/clock" = { rate = 500, nam = "/c", on = 1 }
"a b" = { on = false }
"/tf" = 3
[servces]
"""
    lines = mistake_in(tmp_path, text).split("\n")
    assert [line.partition(": ")[0] for line in lines] == [
        *("s.toml:1", "s.toml:2", "s.toml:3", "s.toml:5"),
        *("s.toml:7", "s.toml:7", "s.toml:7", "s.toml:8", "s.toml:9", "s.toml:10"),
    ]
    assert lines[0].endswith("prot: no such setting (did you mean port?)")
    assert lines[-1].endswith("servces: no such setting (did you mean services?)")


def test_conflicting_settings_are_reported_with_other_errors(tmp_path: Path) -> None:
    text = """\
prot = 1
outbox-size = "8MiB"
outbox-limit = "1MiB"
[publishers]
"/clock" = { rate = 500, name = 3, on = 1 }
"/Ego_topci" = { rate = 5 }
"/tf" = { name = "/a" }
"/imu" = { name = "/a" }
"/gps" = { name = "/client_count" }
[services]
"/SyncModeCmd" = { name = "/s" }
"/sim/reset" = { name = "/s" }
"""
    lines = mistake_in(tmp_path, text).split("\n")
    assert [line.partition(": ")[0] for line in lines] == [
        *("s.toml:1", "s.toml:5", "s.toml:5", "s.toml:5", "outbox-limit"),
        *("s.toml:9", "s.toml:6", "s.toml:8", "s.toml:11"),
    ]
    assert lines[6].endswith("the simulator has no such publisher (did you mean /Ego_topic?)")


def test_conflict_with_an_unreadable_setting_is_not_reported(tmp_path: Path) -> None:
    (line,) = mistake_in(tmp_path, 'outbox-size = "big"\noutbox-limit = "1MiB"\n').split("\n")
    assert line.startswith("s.toml:1: outbox-size: expected")


def test_number_of_reported_errors_is_bounded(tmp_path: Path) -> None:
    lines = mistake_in(tmp_path, "".join(f"x{i} = 1\n" for i in range(500))).split("\n")
    assert len(lines) == 21
    assert lines[-1] == "s.toml: 480 more mistakes"


def test_mock_run_takes_one_file_and_has_no_world() -> None:
    settings = read_settings(["--port", "0", "robot.yaml", "--seed", "3"], {}, command="mock run")
    assert settings == check_options({"mock": "robot.yaml", "port": 0, "seed": 3})
    assert not settings.world
    with pytest.raises(SettingError, match=r"mock run: expected the file of a mock, such as robot\.yaml"):
        read_settings(["--port", "0"], {}, command="mock run")
    assert read_settings([], {"ROSBRIDGE_SIM_MOCK": "robot.yaml"}, command="mock run").mock == "robot.yaml"
    with pytest.raises(SettingError, match=r"mock run: expected one file; got 'a.yaml' and 'b.yaml'"):
        read_settings(["a.yaml", "b.yaml"], {}, command="mock run")


@pytest.mark.parametrize("flag", ["--scenario", "--attach", "--profile", "--sync-lease", "--no-world"])
def test_mock_run_has_no_flags_of_a_world(flag: str) -> None:
    with pytest.raises(SettingError, match=f"{flag}: is a flag of serve; a mock has no world"):
        read_settings(["robot.yaml", flag, "1"], {}, command="mock run")
