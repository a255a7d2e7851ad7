from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.drawing.sensor_thread import SensorThread
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, Makers, Sight, Sighting
from rosbridge_sim.simulator.sensors.picture_sensor import Shot
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from tests import fork_server
from tests.simulator.sensors.analytic_makers import FormulaDrawer, make_makers

CAMERA = CameraSpec(width=16, height=12)
AT = Pose(0.0, 0.0, 0.0)


def job() -> DrawingJob:
    sight = Sight(CAMERA, Motion(AT, Pose(0.0, 0.0, 2.0), 0.0, 0.0), 0)
    road_map = RoadMap("none", Projection(is_tm=False, zone=52), (0.0, 0.0, 0.0), Roads())
    return DrawingJob(road_map, "none", 0, take_frame(World()), [sight])


async def result_of(thread: SensorThread) -> Sequence[Sighting] | Exception:
    found: asyncio.Future[Sequence[Sighting] | Exception] = asyncio.get_running_loop().create_future()
    thread.submit(job(), lambda results, _now: found.set_result(results))
    assert thread.is_busy
    results = await found
    assert not thread.is_busy
    return results


async def test_job_is_drawn_in_the_thread_and_delivered_on_the_loop() -> None:
    makers: list[threading.Thread] = []

    def make() -> Makers:
        makers.append(threading.current_thread())
        return make_makers()

    thread = SensorThread(asyncio.get_running_loop(), FormulaDrawer(make))
    thread.open([CAMERA])
    for _ in range(2):
        results = await result_of(thread)
        assert not isinstance(results, Exception)
        (shot,) = results
        assert isinstance(shot, Shot)
        assert len(shot.data) == 1 + 16 * 12
    assert len(makers) == 1
    assert makers[0] is not threading.current_thread()
    thread.stop()
    thread.stop()
    assert not makers[0].is_alive()


async def test_failure_is_delivered_as_an_exception() -> None:
    def make() -> Makers:
        raise RuntimeError("no GL here")

    thread = SensorThread(asyncio.get_running_loop(), FormulaDrawer(make))
    assert str(await result_of(thread)) == "no GL here"
    thread.stop()


async def test_open_refuses_what_cannot_be_drawn() -> None:
    def make() -> Makers:
        raise RuntimeError("no GL here")

    thread = SensorThread(asyncio.get_running_loop(), FormulaDrawer(make))
    with pytest.raises(DocumentError, match="sensors: no GL here"):
        thread.open([CAMERA])


async def test_nothing_is_delivered_after_the_stop() -> None:
    thread = SensorThread(asyncio.get_running_loop(), FormulaDrawer())
    delivered: list[object] = []
    thread.submit(job(), lambda results, _now: delivered.append(results))
    thread.stop()
    thread.submit(job(), lambda results, _now: delivered.append(results))
    await asyncio.sleep(0)
    assert not delivered


async def test_library_that_is_missing_is_named() -> None:
    """In a process in which the libraries cannot be imported."""
    program = (
        "import sys\n"
        "for name in ('moderngl', 'simplejpeg', 'embreex'): sys.modules[name] = None\n"
        "from rosbridge_sim.__main__ import main\n"
        "sys.argv[1:] = ['--port', '0', '--sensors', sys.argv[1]]\n"
        "sys.exit(main())\n"
    )
    for choice, what in (("camera", "cameras need the library moderngl"), ("lidar", "lidars need the library embreex")):
        done = await asyncio.to_thread(fork_server.run, ["-c", program, choice])
        assert done.returncode == 2
        assert f"{what}: pip install 'rosbridge-sim[sensors]'" in done.stderr
        assert "Traceback" not in done.stderr
