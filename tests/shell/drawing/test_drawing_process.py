"""The process that draws; skipped where Embree is not installed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator

import pytest

from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.shell.drawing.drawing_process import DrawingError, DrawingProcess
from rosbridge_sim.shell.drawing.sensor_makers import make_makers
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, Sight, draw
from rosbridge_sim.simulator.sensors.lidar_3d import Cloud, Lidar3dSpec
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from tests import fork_server
from tests.shell.rendering.graphics import put

pytest.importorskip("embreex")

pytestmark = pytest.mark.slow

NO_ROADS = RoadMap("none", Projection(is_tm=False, zone=52), (0.0, 0.0, 0.0), Roads())


def job(distance: float = 20.0) -> DrawingJob:
    """A lidar before a car."""
    world = World()
    put(world, "2016_Hyundai_Ioniq", distance, 0.0)
    sight = Sight(Lidar3dSpec(columns=1800), Motion(Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 1.0), 0.0, 0.0), -1)
    return DrawingJob(NO_ROADS, "none", 0, take_frame(world), [sight])


def cloud_of(process: DrawingProcess, job: DrawingJob) -> Cloud:
    (cloud,) = process.draw(job)
    assert isinstance(cloud, Cloud)
    return cloud


@pytest.fixture(scope="module")
def shared_process() -> Iterator[DrawingProcess]:
    process = DrawingProcess()
    yield process
    process.kill()


def test_process_gives_the_bytes_that_this_process_gives(shared_process: DrawingProcess) -> None:
    for distance in (10.0, 20.0):  # the second job finds the map there
        (here,) = draw(job(distance), make_makers())
        there = cloud_of(shared_process, job(distance))
        assert isinstance(here, Cloud)
        assert there.num > 40
        assert (there.num, there.data) == (here.num, here.data)


def test_job_that_fails_is_told_and_the_next_one_is_done(shared_process: DrawingProcess) -> None:
    bad = job()
    wrong = Sight(Lidar3dSpec().changed(model="none"), bad.sights[0].motion, -1)
    with pytest.raises(DrawingError):
        shared_process.draw(DrawingJob(bad.road_map, bad.map_name, bad.seed, bad.frame, [wrong]))
    pid = shared_process.pid
    assert cloud_of(shared_process, job()).num
    assert shared_process.pid == pid


def test_process_that_is_killed_is_started_again(shared_process: DrawingProcess) -> None:
    before = cloud_of(shared_process, job())
    assert shared_process.pid is not None
    os.kill(shared_process.pid, signal.SIGKILL)
    with pytest.raises(DrawingError, match=r"the process that draws has ended \(signal 9\)"):
        shared_process.draw(job())
    assert cloud_of(shared_process, job()).data == before.data


@pytest.mark.skipif(sys.platform != "linux", reason="needs a bound on another process's memory")
def test_process_without_memory_is_told_and_draws_again_when_there_is_some(shared_process: DrawingProcess) -> None:
    import resource  # noqa: PLC0415 - not on Windows

    before = cloud_of(shared_process, job())
    assert shared_process.pid is not None
    resource.prlimit(shared_process.pid, resource.RLIMIT_AS, (1, resource.RLIM_INFINITY))
    large = job()
    rays = Lidar3dSpec(model="own", elevations=tuple(range(-60, 60)), columns=4_000)
    many = DrawingJob(NO_ROADS, "none", 0, large.frame, [Sight(rays, large.sights[0].motion, -1)])
    with pytest.raises(DrawingError):
        shared_process.draw(many)
    if shared_process.pid is not None:  # it told the error, and lives
        resource.prlimit(shared_process.pid, resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert cloud_of(shared_process, job()).data == before.data


def test_process_that_keeps_ending_is_not_started_for_each_job(monkeypatch: pytest.MonkeyPatch) -> None:
    process = DrawingProcess()
    monkeypatch.setattr(sys, "executable", "/bin/false")
    for _ in range(3):
        with pytest.raises(DrawingError, match=r"has ended \(exit code 1\)"):
            process.draw(job())
    monkeypatch.undo()  # it could be started now
    with pytest.raises(DrawingError, match="keeps ending"):
        process.draw(job())


def test_process_ends_with_its_parent() -> None:
    """The parent dies without a word; `run` returns when nobody holds its pipe any longer."""
    program = (
        "import os\n"
        "from rosbridge_sim.shell.drawing.drawing_process import DrawingProcess\n"
        "from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec\n"
        "process = DrawingProcess()\n"
        "process.open([Lidar3dSpec()])\n"
        "os.kill(os.getpid(), 9)\n"
    )
    done = fork_server.run(["-c", program])
    assert done.returncode == -signal.SIGKILL
    assert not done.stderr


def test_killed_process_is_gone_and_stays_away(shared_process: DrawingProcess) -> None:
    """The last test of the shared process."""
    shared_process.open([Lidar3dSpec()])
    pid = shared_process.pid
    assert pid is not None
    shared_process.kill()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    for _ in range(2):
        with pytest.raises(DrawingError):
            shared_process.draw(job())
    assert shared_process.pid is None
