"""Eight kinds of clients of the mixed soak: each function is one life, from connecting to leaving.

A life behaves as such programs do. It checks everything that it can know while others change the same world. It leaves
in order, by a crash, or by a reset. Each raises `SoakError` for an answer that is wrong or missing.
"""

from __future__ import annotations

import asyncio
import base64
import math
import random
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from io import BytesIO

import cbor2
import orjson
from PIL import Image

from scripts.soak.harness import PATIENCE, Frame, GoneError, RefusedError, SoakError
from scripts.soak.scenes import BAD, BUILT_IN, GOOD, MISSING
from scripts.soak.soak_client import Client, handshake, masked, open_raw, reset

STATE_TOPICS = (
    *(
        "/Ego_topic",
        "/Object_topic",
        "/CollisionData",
        "/VehicleCollisionData",
        "/GetTrafficLightStatus",
        "/InsnStatus",
    ),
    *("/IntscnTL_topic", "/gps", "/imu", "/ReplayInfo_topic", "/SyncModeInfo", "/tf", "/tf_static", "/clock"),
)

SERVICES = ("/soak/add_0", "/soak/add_1", "/soak/add_2")

ACTIONS = ("/soak/fibonacci_0", "/soak/fibonacci_1")

MASTERS = ("soak master 0", "soak master 1")

SERVICE_TIMEOUT = 5.0
"""Longest wait of some callers for a service that may be silent [s]."""

LAST_NUMBERS = 20
"""Largest length of a requested Fibonacci sequence."""


@dataclass
class Place:
    """Shared data of all lives.

    Attributes:
        url, port: of the server.
        end: time on the loop's clock after which no life begins [s].
        longest_life: of a client [s].
        num: counts of acts, by name.
    """

    url: str
    port: int
    end: float
    longest_life: float = 5.0
    num: Counter[str] = field(default_factory=Counter)

    def until(self, chance: random.Random) -> float:
        """Return the end of a life that begins now.

        Args:
            chance: the random generator.

        Returns:
            Time on the loop's clock [s].
        """
        return min(self.end, asyncio.get_running_loop().time() + chance.uniform(0.1, self.longest_life))

    @asynccontextmanager
    async def client(self) -> AsyncIterator[Client]:
        """Connect a client for a block; its connection is closed at the block's end in all cases.

        Yields:
            The client.
        """
        client = await Client.open(self.url)
        try:
            yield client
        finally:
            await client.cut()

    async def leave(self, client: Client, chance: random.Random) -> None:
        """End a connection in one of the ways of real programs.

        Args:
            chance: the random generator.
        """
        way = chance.random()
        if way < 0.6:
            await client.close()
        else:
            await client.cut(is_reset=way < 0.8)


def _is_before(end: float) -> bool:
    return asyncio.get_running_loop().time() < end


async def _wait(end: float) -> None:
    await asyncio.sleep(max(0.0, end - asyncio.get_running_loop().time()))


# 1 and 2: subscribers


async def subscriber(place: Place, chance: random.Random) -> None:
    """Live as a dashboard: all state topics, throttled, with a queue, as roslibpy subscribes."""
    async with place.client() as client:
        end = place.until(chance)
        for i, topic in enumerate(STATE_TOPICS):
            rate = chance.choice((0, 20, 50, 100, 500))
            await client.send(
                "subscribe",
                topic=topic,
                id=f"subscribe:{topic}:{i}",
                throttle_rate=rate,
                queue_length=chance.choice((0, 1, 5)),
            )
        await client.next_message("/clock")
        while _is_before(end):
            await asyncio.sleep(0.1)
            if chance.random() < 0.1:
                topic = chance.choice(STATE_TOPICS[:-1])  # the clock stays as it is
                await client.send("unsubscribe", topic=topic)
                await client.send(
                    "subscribe", topic=topic, compression=chance.choice(("none", "png")), throttle_rate=200
                )
        await client.next_message("/clock")
        _expect_no_complaint(client)
        place.num["messages heard"] += client.num_heard.total()
        await place.leave(client, chance)


async def cbor_subscriber(place: Place, chance: random.Random) -> None:
    """Live as a recorder that requests CBOR and reads each message."""
    async with place.client() as client:
        end = place.until(chance)
        wrong: list[str] = []

        def read(frame: Frame) -> None:
            message = cbor2.loads(frame["data"])
            if message["op"] != "publish" or message["topic"] not in STATE_TOPICS or not message["msg"]:
                wrong.append(repr(message)[:200])

        client.on_op["binary"] = read
        for topic in STATE_TOPICS:
            await client.send(
                "subscribe", topic=topic, compression=chance.choice(("cbor", "cbor-raw")), throttle_rate=40
            )
        await _wait(end)
        await client.call("/rosapi/get_time")
        if wrong:
            raise SoakError(f"a frame of CBOR is not a message: {wrong[0]}")
        _expect_no_complaint(client)
        place.num["messages in CBOR"] += client.num_heard["binary"]
        await place.leave(client, chance)


# 3 and 4: drivers


async def planner(place: Place, chance: random.Random) -> None:
    """Live as a planner: read the ego's state, and command it fifty times a second."""
    async with place.client() as client:
        end = place.until(chance)
        await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
        await client.send("subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus", throttle_rate=20)
        heading = (await client.next_message("/Ego_topic"))["heading"]
        if not -360 <= heading <= 360:
            raise SoakError(f"the ego's heading is {heading}")
        while _is_before(end):
            command = {"longlCmdType": chance.choice((1, 2, 3)), "accel": chance.random(), "velocity": 30.0}
            await client.send("publish", topic="/ctrl_cmd", msg={**command, "steering": chance.uniform(-0.2, 0.2)})
            place.num["commands"] += 1
            await asyncio.sleep(0.02)
        _expect_no_complaint(client)
        if chance.random() < 0.5:
            await client.send("unadvertise", topic="/ctrl_cmd")
        await place.leave(client, chance)


async def master(place: Place, chance: random.Random) -> None:
    """Live as a test bench: start synchronous mode, tick, and stop it, or crash as master."""
    async with place.client() as client:
        end = place.until(chance)
        name = chance.choice(MASTERS)
        started = await client.request("/SyncModeCmd", user_id=name, start_sync_mode=True, time_step=20)
        while started["result"] and _is_before(end):
            command = {"longlCmdType": 2, "velocity": 20.0, "steering": 0.05}
            await client.request("/SyncModeCtrlCmd", frame=0, command=command, sensor_capture=False)
            answer = await client.request("/SyncModeWaitForTick", user_id=name, frame=0)
            place.num["ticks" if answer["tick_status"] else "ticks refused"] += 1
            await asyncio.sleep(chance.uniform(0.0, 0.02))
        if chance.random() < 0.7:
            await client.request("/SyncModeCmd", user_id=name, start_sync_mode=False, time_step=20)
        place.num["masters"] += bool(started["result"])
        await place.leave(client, chance)


# 5: services


async def provider(place: Place, chance: random.Random) -> None:
    """Live as a node with a service: answer at once, late, with a failure, or never; perhaps leave with open calls."""
    async with place.client() as client:
        end = place.until(chance)
        service = chance.choice(SERVICES)
        answering: set[asyncio.Task[None]] = set()

        async def answer(frame: Frame) -> None:
            await asyncio.sleep(chance.choice((0.0, 0.0, 0.05, 0.5)))
            args, is_well = frame["args"], chance.random() < 0.9
            values: object = {"sum": args["a"] + args["b"]} if is_well else "out of paper"
            with suppress(GoneError):
                await client.send("service_response", service=service, id=frame["id"], values=values, result=is_well)

        def take(frame: Frame) -> None:
            if chance.random() < 0.9:
                task = asyncio.get_running_loop().create_task(answer(frame))
                answering.add(task)
                task.add_done_callback(answering.discard)

        client.on_op["call_service"] = take
        await client.send("advertise_service", service=service, type="example_interfaces/AddTwoInts")
        await _wait(end)
        if chance.random() < 0.3:
            await client.send("unadvertise_service", service=service)
        await place.leave(client, chance)
        if answering:
            await asyncio.wait(answering)


async def caller(place: Place, chance: random.Random) -> None:
    """Live as a program that calls such services, and perhaps leaves during a call."""
    async with place.client() as client:
        end = place.until(chance)
        while _is_before(end):
            service, a, b = chance.choice(SERVICES), chance.randrange(2**40), chance.randrange(2**40)
            args = {"a": a, "b": b}
            if chance.random() < 0.1:
                await client.send("call_service", service=service, args=args, id="unheard")
                break
            fields = {"timeout": SERVICE_TIMEOUT} if chance.random() < 0.5 else {}
            try:
                values = await client.call(service, args, **fields)
            except RefusedError:
                place.num["calls refused"] += 1
            else:
                if values != {"sum": a + b}:
                    raise SoakError(f"{service} of {args} answered {values}")
                place.num["calls answered"] += 1
            await asyncio.sleep(chance.uniform(0.0, 0.05))
        await place.leave(client, chance)


# 6: actions


async def action_server(place: Place, chance: random.Random) -> None:
    """Live as a node with an action: feedback, results, obeyed cancels, and goals that it leaves behind."""
    async with place.client() as client:
        end = place.until(chance)
        action = chance.choice(ACTIONS)
        cancelled: set[str] = set()
        working: set[asyncio.Task[None]] = set()

        async def work(goal: Frame) -> None:
            sequence = [0, 1]
            common = {"action": action, "id": goal["id"]}
            with suppress(GoneError):
                while len(sequence) < goal["args"]["order"] and goal["id"] not in cancelled:
                    sequence.append(sequence[-1] + sequence[-2])
                    await client.send("action_feedback", **common, values={"sequence": sequence})
                    await asyncio.sleep(0.02)
                status = 5 if goal["id"] in cancelled else 4  # action_msgs/GoalStatus: cancelled, succeeded
                await client.send("action_result", **common, values={"sequence": sequence}, status=status, result=True)
            cancelled.discard(goal["id"])

        def take(goal: Frame) -> None:
            task = asyncio.get_running_loop().create_task(work(goal))
            working.add(task)
            task.add_done_callback(working.discard)

        client.on_op["send_action_goal"] = take
        client.on_op["cancel_action_goal"] = lambda frame: cancelled.add(frame["id"])
        await client.send("advertise_action", action=action, type="example_interfaces/Fibonacci")
        await _wait(end)
        if chance.random() < 0.3:
            await client.send("unadvertise_action", action=action)
        await place.leave(client, chance)
        if working:
            await asyncio.wait(working)


async def goal_sender(place: Place, chance: random.Random) -> None:
    """Live as a program that sends such goals, cancels some, and perhaps leaves during one."""
    async with place.client() as client:
        end = place.until(chance)
        kind = "example_interfaces/Fibonacci"
        while _is_before(end):
            action, order = chance.choice(ACTIONS), chance.randrange(2, LAST_NUMBERS)
            goal = {"action": action, "action_type": kind, "args": {"order": order}, "feedback": chance.random() < 0.7}
            if chance.random() < 0.1:
                await client.send("send_action_goal", **goal, id="unheard")
                break
            mark = f"call-{client.num_calls + 1}"
            answer = asyncio.ensure_future(client.answer("send_action_goal", **goal))
            if chance.random() < 0.3:
                await asyncio.sleep(chance.uniform(0.0, 0.2))
                await client.send("cancel_action_goal", action=action, id=mark)
            result = await answer
            if not result["result"]:
                place.num["goals refused"] += 1
            elif result["status"] == 4 and len(result["values"]["sequence"]) != order:
                raise SoakError(f"a goal of {order} numbers has {result}")
            else:
                place.num["goals"] += 1
            await asyncio.sleep(chance.uniform(0.0, 0.05))
        await place.leave(client, chance)


# 7: clients that change the scene


async def director(place: Place, chance: random.Random) -> None:
    """Live as a scenario runner: load, reset, pause, add and remove objects, and save sensor data."""
    async with place.client() as client:
        end = place.until(chance)
        while _is_before(end):
            act = chance.choice((_load, _load, _reset, _pause, _spawn, _spawn, _capture, _refuse))
            await act(client, chance)
            place.num[act.__name__.strip("_")] += 1
            await asyncio.sleep(chance.uniform(0.1, 0.6))
        await place.leave(client, chance)


_LOAD = {
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
}


async def _load(client: Client, chance: random.Random) -> None:
    name = chance.choice((*GOOD, *BUILT_IN))
    # without `delete_all` the crowd would only grow
    answer = await client.request("/Service_MoraiSL", file_name=name, delete_all=True, **_LOAD)
    if not answer["result"]:
        raise SoakError(f"{name!r} was not loaded: {client.told[-1:]}")


async def _refuse(client: Client, chance: random.Random) -> None:
    name = chance.choice((*BAD, *MISSING))
    if (await client.request("/Service_MoraiSL", file_name=name, delete_all=True, **_LOAD))["result"]:
        raise SoakError(f"{name[:80]!r} was loaded")


async def _reset(client: Client, chance: random.Random) -> None:
    await client.call("/sim/reset", {"seed": chance.choice((-1, 0, 7))})


async def _pause(client: Client, _chance: random.Random) -> None:
    await client.request("/Service_MoraiEventCmd", option=8, set_pause=True)
    await asyncio.sleep(0.05)
    await client.request("/Service_MoraiEventCmd", option=8, set_pause=False)


async def _spawn(client: Client, chance: random.Random) -> None:
    at = {"x": chance.uniform(-100, 100), "y": chance.uniform(-100, 100), "z": 0.0}
    number = chance.randrange(1000, 1040)
    ghost = {"unique_id": number, "name": "2015_Kia_K5", "position": at}
    await client.send("publish", topic="/NpcGhost_Topic", type="morai_msgs/NpcGhostCmd", msg={"npc_list": [ghost]})
    box = {"name": "Box", "position": at, "frame": 0}
    await client.send("publish", topic="/SyncModeAddObj", type="morai_msgs/SyncModeAddObj", msg=box)
    gone = {"unique_id": number, "frame": 0}
    await client.send("publish", topic="/SyncModeRemoveObj", type="morai_msgs/SyncModeRemoveObj", msg=gone)
    if chance.random() < 0.2:
        names = (
            "global_position_x",
            "global_position_y",
            "global_position_z",
            "global_roll",
            "global_pitch",
            "global_yaw",
        )
        ego = {"number_of_ego_vehicle": 1, "ego_index": [2], "gear": [4], "ctrl_mode": [16], "velocity": [0.0]}
        ego |= {name: [30.0] for name in names}
        await client.send("publish", topic="/ego_setting", type="morai_msgs/MultiEgoSetting", msg=ego)
    await client.call("/rosapi/get_time")


async def _capture(client: Client, _chance: random.Random) -> None:
    msg = {"is_custom_file_name": True, "custom_file_name": "soak", "file_dir": ""}
    await client.send("publish", topic="/SaveSensorData", type="morai_msgs/SaveSensorData", msg=msg)
    await client.call("/rosapi/get_time")


# 8: rude clients


async def rude(place: Place, chance: random.Random) -> None:
    """Live as a rude client: break off, break rules, do not read, or send rubbish."""
    act = chance.choice((_break_handshake, _break_frame, _break_rules, _read_slowly, _send_rubbish, _send_pieces))
    with suppress(OSError, EOFError):  # the server may disconnect such a client
        await act(place, chance)
    place.num[act.__name__.strip("_")] += 1


async def _break_handshake(place: Place, chance: random.Random) -> None:
    _reader, writer = await open_raw(place.port, is_greeting=False)
    greeting = chance.choice(
        (handshake(), b"\x16\x03\x01\x02\x00\x01", b"POST / HTTP/1.1\r\n\r\n", b"GET /" + b"x" * 9000)
    )
    writer.write(greeting[: chance.randrange(len(greeting))])
    await asyncio.sleep(chance.choice((0.0, 0.0, 0.3)))
    _break_off(writer, chance)


async def _break_frame(place: Place, chance: random.Random) -> None:
    _reader, writer = await open_raw(place.port)
    data = b'{"op":"publish","topic":"/soak/half","type":"std_msgs/String","msg":{"data":"%s"}}' % (b"y" * 100_000)
    frame = masked(data)
    writer.write(frame[: chance.randrange(len(frame))])
    await asyncio.sleep(chance.choice((0.0, 0.0, 0.3)))
    _break_off(writer, chance)


async def _break_rules(place: Place, chance: random.Random) -> None:
    reader, writer = await open_raw(place.port)
    breaches = (
        b"\x81\x02{}",  # not masked
        masked(b"{}", first=0xF1),  # bits of an extension that there is not
        masked(b"p" * 200, first=0x89),  # a ping that is too long
        masked(b"{}", first=0x80),  # the rest of a message that has not begun
        b"\x81\xff" + (2**40).to_bytes(8, "big") + bytes(4),  # a length above any limit
    )
    breach = chance.choice(breaches)
    writer.write(breach)
    try:
        async with asyncio.timeout(PATIENCE):
            while await reader.read(1 << 16):
                pass
    except TimeoutError:
        raise SoakError(f"a connection that broke WebSocket's rules was not closed: {breach[:20]!r}") from None
    _break_off(writer, chance)


async def _read_slowly(place: Place, chance: random.Random) -> None:
    _reader, writer = await open_raw(place.port, buffer=4096)
    for topic in STATE_TOPICS:
        writer.write(masked(orjson.dumps({"op": "subscribe", "topic": topic})))
    writer.write(masked(b'{"op":"call_service","service":"/rosapi/topics"}') * 50)
    await asyncio.sleep(chance.uniform(0.5, place.longest_life))
    _break_off(writer, chance)


async def _send_rubbish(place: Place, chance: random.Random) -> None:
    """Send frames that are not ops; each is answered, and the connection goes on."""
    async with place.client() as client:
        rubbish: tuple[str | bytes, ...] = (
            *("", "{", "[]", "null", "NaN", '{"op":1}', '{"op":"zzz"}', "[" * 2000, '{"op":"publish"}', "{} {} {"),
            *(b"\xff\xff", b"\xa1", b'{"op":"subscribe","topic":7}', bytes(300)),
        )
        for _ in range(30):
            await client.send_raw(chance.choice(rubbish))
        await client.call("/rosapi/get_time")
        if not client.told:
            raise SoakError("thirty frames of rubbish got no status")
        await place.leave(client, chance)


async def _send_pieces(place: Place, chance: random.Random) -> None:
    """Send ops in fragments and in pictures, whole and broken."""
    async with place.client() as client:
        op = orjson.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "call-1"}).decode()
        cuts = [op[i : i + 20] for i in range(0, len(op), 20)]
        pieces = [
            {"op": "fragment", "id": "f", "num": i, "total": len(cuts), "data": data} for i, data in enumerate(cuts)
        ]
        chance.shuffle(pieces)
        for piece in pieces[:-1]:
            await client.send_raw(orjson.dumps(piece).decode())
        for number in range(chance.randrange(40)):  # beginnings of messages that never end
            await client.send("fragment", id=f"half-{number}", num=0, total=3, data="x" * 1000)
        await client.send_raw(orjson.dumps(pieces[-1]).decode())
        picture = _draw(op.replace("call-1", "call-2").encode())
        cut = chance.randrange(len(picture))
        await client.send("png", data=picture[:cut] + "AAAA" + picture[cut + 4 :])
        await client.send("png", data=picture)
        await client.call("/rosapi/get_time")
        await place.leave(client, chance)


def _draw(text: bytes) -> str:
    """Return the picture that holds a text as RGB bytes, about square, as rosbridge_suite draws it."""
    width = math.ceil(math.sqrt(len(text) / 3))
    height = math.ceil(len(text) / 3 / width)
    file = BytesIO()
    Image.frombytes("RGB", (width, height), text.ljust(3 * width * height, b"\n")).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def _break_off(writer: asyncio.StreamWriter, chance: random.Random) -> None:
    if chance.random() < 0.5:
        reset(writer.transport)
    writer.transport.abort()


def _expect_no_complaint(client: Client) -> None:
    if client.told:
        raise SoakError(f"a client without a mistake got an error: {client.told[0]}")


KINDS: dict[Callable[[Place, random.Random], Awaitable[None]], int] = {
    subscriber: 3,
    cbor_subscriber: 2,
    planner: 2,
    master: 2,
    provider: 2,
    caller: 4,
    action_server: 2,
    goal_sender: 3,
    director: 1,
    rude: 4,
}
"""Number of clients of each kind at one time: enough to affect each other, and few enough for one core."""
