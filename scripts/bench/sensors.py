#!/usr/bin/env python3
"""Cameras and lidars: CPU time of each kind of reading, and what a server with both does for its clients.

    python scripts/bench/sensors.py [--map town] [--rounds 20] [--seconds 10]

The first table is CPU time of this process, all threads, so it holds on a busy machine. The floor of a picture is the
bare renderer: the triangles of the static map in one piece, one colour each, no light, with the same four samples, and
read back. The floor of a turn is Embree alone, with rays that are ready.

The second table is of a server in a process of its own, with smooth pictures and with plain ones: ticks a second in
synchronous mode with and without a camera at 30 Hz and a VLP-16 at 10 Hz, and the CPU time of the server and of the
process that draws. Then in real time what roslibpy and roslib hear of both: rate, and how long behind the status of
the same frame a message is there (p50 / p99), also behind a bridge; and the longest wait of a bystander that calls a
service a hundred times a second meanwhile. That depends on what else the machine does. roslib needs Node.js.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.client import Client
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, mount, rotation
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import Channel, PictureChoices
from rosbridge_sim.scenery.scene_frame import SceneFrame, take_frame
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.rendering.camera_renderer import SAMPLES, CameraRenderer, open_context
from rosbridge_sim.shell.rendering.jpeg import encode_jpeg
from rosbridge_sim.shell.rendering.ray_caster import RayCaster
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion, beams_3d, echoes_of, pack_points, sweep
from rosbridge_sim.simulator.sensors.lidar_3d import LIDAR_MODELS
from rosbridge_sim.world.state.world import World
from scripts.bench.reference import reference_line
from scripts.soak.harness import Bystander

ROOT = Path(__file__).resolve().parents[2]
IMAGE, POINTS = "/image_jpeg/compressed", "/velodyne_points"
CAMERA = Pose(1.8, 0.0, 2.0, pitch=math.radians(7.0))
LIDAR = Pose(2.0, 0.0, 1.28)
SIZES = ((320, 240), (640, 480), (1280, 720), (1920, 1080))


def cost(work: Callable[[], object], rounds: int) -> float:
    """Return the median CPU time of a piece of work, after one that prepares it [ms]."""
    work()
    taken = []
    for _ in range(rounds):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return 1e3 * median(taken)


class BareRenderer:
    """Draws a mesh and reads the picture, and does nothing else."""

    def __init__(self, mesh: Mesh, size: tuple[int, int]) -> None:
        """Take a mesh.

        Args:
            mesh: the triangles.
            size: of the picture [pixels].
        """
        context = self._context = open_context()
        with context:
            self._program = context.program(
                vertex_shader="#version 330\nuniform mat4 view; in vec3 place; in vec3 colour; flat out vec3 c;"
                "void main() { gl_Position = view * vec4(place, 1); c = colour; }",
                fragment_shader="#version 330\nflat in vec3 c; out vec4 f; void main() { f = vec4(c, 1); }",
            )
            corners = mesh.vertices[mesh.triangles].reshape(-1, 3).astype("<f4")
            colours = np.repeat(mesh.colour.astype("<f4") / 255.0, 3, axis=0)
            self._array = context.vertex_array(
                self._program,
                [
                    (context.buffer(corners.tobytes()), "3f", "place"),
                    (context.buffer(colours.tobytes()), "3f", "colour"),
                ],
            )
            self._many = context.framebuffer(
                [context.renderbuffer(size, 4, samples=SAMPLES)], context.depth_renderbuffer(size, samples=SAMPLES)
            )
            self._one = context.framebuffer([context.renderbuffer(size, 4)])

    def draw(self, view: np.ndarray) -> bytes:
        """Return a picture.

        Args:
            view: (4, 4) matrix from the mesh to the picture.
        """
        context = self._context
        with context:
            self._many.use()
            self._many.clear()
            context.enable_only(context.DEPTH_TEST)
            self._program["view"].write(np.asarray(view.T, dtype="<f4").tobytes())
            self._array.render()
            context.copy_framebuffer(self._one, self._many)
            return bytes(self._one.read(components=3, alignment=1))


def readings(name: str, rounds: int) -> None:
    """Print the CPU time of pictures and turns.

    Args:
        name: of the map.
        rounds: readings of each kind.
    """
    from rosbridge_sim.shell.rendering.camera_renderer import _matrices  # noqa: PLC0415 - the same view for both

    begun = time.process_time()
    road_map = DiskLibrary().map(name)
    static = static_mesh(road_map, name, 0)
    print(f"{name}: {len(static):,} triangles, built in {time.process_time() - begun:.2f} s")
    roads = road_map.roads
    lane = int(roads.length.argmax())
    (point,), (yaw,) = roads.at([lane], [0.3 * roads.length[lane]])
    car, frame = Pose(point[0], point[1], point[2], yaw=float(yaw)), take_frame(World())
    renderer, caster = CameraRenderer(), RayCaster()
    print(
        f"drawn by {renderer.device}\n\n{'picture':34}{'drawn':>9}{'bare':>9}{'ratio':>8}{'JPEG':>9}{'all parts':>11}"
    )
    for width, height in SIZES:
        camera, pose = CameraModel(width, height, 90.0), mount(car, CAMERA)
        eye = np.array(pose[:3]) - static.origin
        bare, (view, _) = BareRenderer(static, (width, height)), _matrices(camera, rotation(*pose[3:]), eye)

        draw = partial(renderer.render, static, frame, camera, pose)
        own = cost(partial(draw, PictureChoices(channels=Channel.RGB)), rounds)
        floor = cost(partial(bare.draw, view), rounds)
        rgb = draw(PictureChoices(channels=Channel.RGB)).rgb
        assert rgb is not None
        jpeg, whole = cost(partial(encode_jpeg, rgb, 90), rounds), cost(draw, rounds)
        print(f"{f'{width} x {height} [ms]':34}{own:9.1f}{floor:9.1f}{own / floor:8.2f}{jpeg:9.1f}{whole:11.1f}")
    print(f"\n{'turn':34}{'whole':>9}{'Embree':>9}{'ratio':>8}")
    for model, columns in (("VLP-16", 1800), ("OS1-64", 1024), ("OS1-128", 1024)):
        turn(caster, static, frame, car, model, columns=columns, rounds=rounds)


def turn(
    caster: RayCaster, static: Mesh, frame: SceneFrame, car: Pose, model: str, *, columns: int, rounds: int
) -> None:
    """Print the CPU time of a turn of a lidar, from the motion of its car to the bytes of its points."""
    beams = beams_3d(np.radians(LIDAR_MODELS[model].elevations_deg), columns, 0.1)
    motion = Motion(car, LIDAR, 10.0, 0.1)

    def work() -> None:
        origins, directions = sweep(motion, beams, static.origin)
        hits = caster.cast(static, frame, origins, directions, 100.0)
        pack_points(echoes_of(hits, directions), beams, 0.5, 100.0)

    origins, directions = sweep(motion, beams, static.origin)
    reach = np.full(len(directions), 100.0, dtype=np.float32)
    whole = cost(work, rounds)
    scene = caster._scene(static)  # noqa: SLF001 - the floor needs the library's own object
    floor = cost(lambda: scene.run(origins, directions, dists=reach, query="INTERSECT", output=True), rounds)
    print(f"{f'{model}, {columns} columns [ms]':34}{whole:9.1f}{floor:9.1f}{whole / floor:8.2f}")


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def family_of(pid: int) -> list[int]:
    """Return a process and its children."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [pid, *(int(child) for task in tasks for child in task.read_text().split())]


@contextmanager
def started(*words: str) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Run a program of ours until the end of the block; yield it, and the port that it listens on (0 for attach)."""
    with tempfile.TemporaryDirectory() as folder:
        port_file = Path(folder) / "port"
        command = [sys.executable, "-m", "rosbridge_sim", *words, "--data-dir", folder, "--log-level", "error"]
        if words[0] == "serve":
            command += ["--port", "0", "--port-file", str(port_file)]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as program:  # noqa: S603 - ours
            try:
                while words[0] == "serve" and not (port_file.exists() and port_file.read_text().strip()):
                    if program.poll() is not None:
                        raise SystemExit(f"{' '.join(command)}: it has ended with {program.returncode}")
                    time.sleep(0.1)
                yield program, int(port_file.read_text()) if words[0] == "serve" else 0
            finally:
                program.terminate()


TOPICS = {IMAGE: "sensor_msgs/CompressedImage", POINTS: "sensor_msgs/PointCloud2"}

PYTHON = (sys.executable, "-m", "tests.end_to_end.clients.rates", "asyncio")
NODE = ("node", str(ROOT / "tests" / "end_to_end" / "clients" / "rates.mjs"), "roslib")


def serving(name: str, ticks: int, seconds: float) -> None:
    """Print what a server with a camera and a lidar does, with smooth pictures and with plain ones.

    Args:
        name: of the scenario.
        ticks: in synchronous mode, of 20 ms.
        seconds: of each run in real time.
    """
    with tempfile.TemporaryDirectory() as folder:
        for is_smooth in (True, False):
            rig = Path(folder) / "rig.toml"
            rig.write_text(RIG.format(str(is_smooth).lower()))
            print(f"\n{'four samples a pixel' if is_smooth else 'plain pictures'}")
            with started("serve", "--scenario", name, "--sensors", str(rig)) as (server, port):
                with Client(f"ws://127.0.0.1:{port}", timeout=120.0) as client:
                    _ticks(client, server.pid, ticks)
                for command, role, words in (
                    (PYTHON, "roslibpy, JSON", ()),
                    (NODE, "roslib, JSON", ("none",)),
                    (NODE, "roslib, CBOR", ("cbor",)),
                ):
                    _carried([*command, str(port), "count", *words], role, server.pid, port, seconds)
            with started("serve", "--no-world") as (_, port):
                far = f"ws://127.0.0.1:{port}"
                with started("attach", far, "--scenario", name, "--sensors", str(rig)) as (simulator, _):
                    with Client(far, timeout=120.0) as client:
                        client.wait_for(IMAGE, type_name=TOPICS[IMAGE])
                    at_bridge = [*PYTHON, str(port), "count"]
                    _carried(at_bridge, "roslibpy, behind attach", simulator.pid, port, seconds)


RIG = """[[camera]]
x = 1.8
z = 2
pitch = 7
antialiasing = {}
[[lidar3d]]
x = 2
z = 1.28
"""


def _ticks(client: Client, pid: int, ticks: int) -> None:
    client.start_sync()
    for with_sensors in (False, True):
        topics = [client.subscribe(topic) for topic in TOPICS] if with_sensors else []
        if with_sensors:
            client.tick(10)  # the first picture of a map takes seconds
        pids = family_of(pid)
        before, begun = [cpu_of(each) for each in pids], time.perf_counter()
        for _ in range(ticks):
            client.tick()
        taken = time.perf_counter() - begun
        shares = [100.0 * (cpu_of(each) - was) / (0.02 * ticks) for each, was in zip(pids, before, strict=True)]
        heard = sum(len(topic.take()) for topic in topics)
        print(
            f"{'with' if with_sensors else 'without'} both: {ticks / taken:.0f} ticks/s; a simulated second costs"
            f" {shares[0]:.0f} % of a core in the server, {sum(shares[1:]):.0f} % for drawing; {heard} messages"
        )
        for topic in topics:
            topic.close()
    client.stop_sync()


def _carried(command: Sequence[str], role: str, pid: int, port: int, seconds: float) -> None:
    """Print what a client hears in real time, and how long a bystander waits meanwhile."""
    words = [*command, *(f"{name}={type_name}" for name, type_name in TOPICS.items())]
    bystander = Bystander(f"ws://127.0.0.1:{port}")
    try:
        with subprocess.Popen(  # noqa: S603 - ours
            words, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as program:
            assert program.stdout is not None
            program.stdout.readline()
            time.sleep(2.0)  # the first pictures
            asyncio.run(bystander.waits())
            before, pids = [cpu_of(each) for each in family_of(pid)], family_of(pid)
            time.sleep(seconds)
            used = [100.0 * (cpu_of(each) - was) / seconds for each, was in zip(pids, before, strict=True)]
            waits = asyncio.run(bystander.waits())
            out, _ = program.communicate()
    finally:
        bystander.stop()
    seen = json.loads(out.splitlines()[-1])
    parts = [f"{role:24}"]
    for name in TOPICS:
        delays = np.array(seen["delays"][name] or [math.nan])
        rate = seen["counts"][name] / max(seen["seconds"], 1e-9)
        parts.append(f"{rate:5.1f} Hz, {np.percentile(delays, 50):4.0f} / {np.percentile(delays, 99):4.0f} ms")
    parts.append(f"server {used[0]:.0f} %, drawing {sum(used[1:]):.0f} %; bystander {waits.longest:.0f} ms")
    print("  ".join(parts))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--map", default="town", help="map, and scenario of the server (%(default)s)")
    parser.add_argument("--rounds", type=int, default=20, help="readings of each kind (%(default)s)")
    parser.add_argument("--ticks", type=int, default=200, help="ticks of the server (%(default)s)")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each client in real time (%(default)s)")
    args = parser.parse_args()
    print(reference_line())
    if args.rounds:
        readings(args.map, args.rounds)
    serving(args.map, args.ticks, args.seconds)


if __name__ == "__main__":
    main()
