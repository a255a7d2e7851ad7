"""Refusals of snapshots: at this moment, for this client, and by what is in them.

Bytes that are no snapshot at all are refused by `plain/snapshot_bytes.py`, values of a wrong type by `typed_plain.py`
beside it. What is here is asked in this order: may the client, does the head fit this simulator, do the parts of the
state fit each other and the map. Later, `node_state.py` tries the state out, `snapshots.py` compares the maps, and
`world/saved_world.py` checks each figure of the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rosbridge_sim.errors import DocumentError, GraphError, Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.scenarios.spawn_points import MAX_AT_ONCE
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import EgoState
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.snapshot_bytes import SnapshotHead
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, FIRST_FREE_EGO, MAX_EGOS, MAX_ENTITIES
from rosbridge_sim.simulator.sync.sync_table import MAX_AHEAD, MAX_WAITING_COMMANDS
from rosbridge_sim.world.drivers.lane_position import MAX_LATERAL
from rosbridge_sim.world.saved_world import LAYOUT
from rosbridge_sim.world.state.entity_arrays import INTS
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_UID, Kind, Snapshot

MAX_LAMPS: Final = (2, 1)
"""Greatest turn and emergency signal, see `Ego`."""

MAX_ORIGIN: Final = 10 * MAX_COORDINATE
"""Greatest figure of an ego's `odom_origin` [m, rad]; it may lie beyond `MAX_COORDINATE`, unlike an ego."""


class Refusal(Exception):  # noqa: N818 - it is no failure
    """Why a request is not carried out, with the kind of reason."""

    def __init__(self, text: str, reason: Reason) -> None:
        super().__init__(text)
        self.reason = reason


# At this moment, and for this client


def check_may_save(context: SimulatorContext) -> None:
    """Check that there is a state between two frames.

    Raises:
        Refusal: there is none.
    """
    if context.stepper.is_moving:
        raise Refusal("the world is moving: take a snapshot between two frames", Reason.NOT_NOW)
    if context.sync.has_unready:
        raise Refusal("a scenario is being read: try again when it has been", Reason.NOT_NOW)


def check_may_read(caller: Participant, publishers: Publishers) -> None:
    """Check that a client may have the bytes of a snapshot.

    Raises:
        Refusal: it must not subscribe to a topic of the simulator.
    """
    for name, type_name in publishers.types:
        try:
            caller.check_subscribe(name, type_name)
        except GraphError as error:
            text = f"with_data: {error}, and the bytes tell what it does; take the snapshot without them"
            raise Refusal(text, error.reason) from None


def check_may_restore(context: SimulatorContext, user_id: str) -> None:
    """Check that nothing stands in the way of a restore by this client.

    Raises:
        Refusal: it does not have the id of the master or of a member of the barrier, or frames are being computed.
    """
    sync = context.sync
    if context.failure.why is not None:
        raise Refusal(context.failure.why, Reason.REFUSED)
    if context.stepper.is_moving:
        raise Refusal("the world is moving: restore between two frames", Reason.NOT_NOW)
    if context.barrier.is_on:
        outcome = context.barrier.ask_restore(user_id)
        if not outcome.is_accepted:
            raise Refusal(context.barrier.why(outcome), outcome.reason)
    elif sync.is_on and not sync.is_master(user_id):
        if not sync.master_id:
            raise Refusal("there is no master: start synchronous mode first", Reason.NO_MASTER)
        raise Refusal(f"another user id is the master: {sync.master_id!r}", Reason.NOT_MASTER)
    if sync.num_ticks:
        raise Refusal("ticks or steps are waiting for their turn: restore when they are done", Reason.NOT_NOW)


# By what is in them


def check_head(head: SnapshotHead, definitions: bytes, profile: str, dynamics: str) -> None:
    """Check that a snapshot was made by a simulator like this one.

    Raises:
        Refusal: it was not.
    """
    if head.layout != LAYOUT:
        raise Refusal("the snapshot was made by another version of rosbridge-sim", Reason.WRONG_VALUE)
    if head.definitions != definitions:
        raise Refusal("the snapshot was made with the messages of another release (--release)", Reason.WRONG_VALUE)
    if head.profile != profile:
        text = f"the snapshot was made with other units and orders: {head.profile[:200]}; here they are {profile}"
        raise Refusal(text, Reason.WRONG_VALUE)
    if head.dynamics != dynamics:
        text = f"the snapshot was made with {head.dynamics[:200]!r}; here it is {dynamics!r}"
        raise Refusal(text, Reason.WRONG_VALUE)


def check_numbers(waiting: Sequence[int], world: Snapshot, next_uid: int) -> None:
    """Check how much is in a state.

    Args:
        waiting: frames of the commands that wait.

    Raises:
        DocumentError: it is more than there may be.
    """
    if (
        len(waiting) > MAX_WAITING_COMMANDS
        or len(world.uids) > MAX_ENTITIES
        or not 0 < next_uid <= MAX_UID + 1
        or not all(0 <= frame <= world.frame + MAX_AHEAD for frame in waiting)
    ):
        raise DocumentError(f"state: expected at most {MAX_WAITING_COMMANDS} commands, and an id to go on with")


def check_egos(egos: tuple[EgoState, ...], world: Snapshot, sensor_frames: tuple[str, ...]) -> None:
    """Check the egos of a state.

    Raises:
        DocumentError: they are not the egos of its world.
    """
    rows, kinds = dict(world.uids), world.ints[INTS.index("kind")]
    indices, uids = {ego.index for ego in egos}, {ego.uid for ego in egos}
    is_good = (
        0 < len(egos) == len(indices) == len(uids) <= MAX_EGOS
        and (egos[0].index, egos[0].uid) == (FIRST_EGO, FIRST_EGO)
        and all(FIRST_FREE_EGO <= ego.index <= MAX_UID for ego in egos[1:])
        and all(ego.uid in rows and kinds[rows[ego.uid]] == Kind.EGO for ego in egos)
        and all(tuple(name for name, _ in ego.mountings)[: len(sensor_frames)] == sensor_frames for ego in egos)
        and all(len(ego.mountings) == len(dict(ego.mountings)) for ego in egos)
        and all(abs(figure) <= MAX_ORIGIN for ego in egos for figure in ego.odom_origin)
        and all(0 <= lamp <= most for ego in egos for lamp, most in zip(ego.lamps, MAX_LAMPS, strict=True))
    )
    if not is_good:
        raise DocumentError("egos: expected the egos of the world, each with its sensors and lamps")


def check_load(load: Load) -> None:
    """Check what `Scene.carry_out` relies on, because `Scene.prepare` has checked it.

    Raises:
        DocumentError: a place or a phase that the map does not have.
    """
    roads, plan = load.road_map.roads, load.road_map.plan
    for spawn in (*load.egos, *load.others):
        driver = spawn.driver
        if driver is not None and not (
            all(0 <= lane < len(roads) for lane in (driver.lane, *driver.route))
            and 0.0 <= driver.s <= roads.length[driver.lane]
            and driver.desired_speed >= 0.0
            and abs(driver.lateral) <= MAX_LATERAL
        ):
            raise DocumentError("load.driver: expected lanes of the map")
        if not 0.0 <= spawn.start_within <= MAX_COORDINATE:
            raise DocumentError("load.start_within: expected a distance")
        if not spawn.is_placed or spawn.link is not None:
            raise DocumentError("load.is_placed: expected places")
    for point in load.spawn_points:
        if not (
            0 <= point.lane < len(roads)
            and -1 <= point.goal_lane < len(roads)
            and 0.0 <= point.s <= roads.length[point.lane]
            and point.models
            and 0 <= point.num <= MAX_AT_ONCE
            and all(0.0 <= low <= high for low, high in (point.period, point.speed, point.desired_speed))
            and point.period[1] <= MAX_COORDINATE
            and -1.0 <= point.wait <= MAX_COORDINATE
            and point.gap >= 0.0
            and point.time >= 0.0
            and -MAX_LATERAL <= point.lateral[0] <= point.lateral[1] <= MAX_LATERAL
        ):
            raise DocumentError("load.spawn_points: expected places and times within their bounds")
    phases = {one.name: int(num) for one, num in zip(plan.controllers, plan.num_phases, strict=True)}
    for start in load.phases:
        if not (0 <= start.phase < phases.get(start.controller, 0) and 0.0 <= start.elapsed <= MAX_COORDINATE):
            raise DocumentError("load.phases: expected phases of the map's intersections")
