"""Actions by rclpy: goals of nodes for actions of the bus, and goals of the bus for actions of nodes."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Final

from rosbridge_sim.graph.actions import Goal, GoalStatus
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType
from rosbridge_sim.graph.ros2.ros2_actions import FarGoalEar, Ros2Actions
from rosbridge_sim.shell.ros2.rclpy_node import READY_PERIOD, RclpyNode
from rosbridge_sim.shell.ros2.rclpy_services import RclpyOffers
from rosbridge_sim.shell.ros2.rclpy_types import RclpyObject, rclpy_errors, read_cdr, write_cdr

VERDICT_PATIENCE: Final = 1.0
"""Longest wait of the thread that spins for the loop, which accepts a goal or not [s]; then it is rejected."""

SERVER_PATIENCE: Final = 10.0
"""Longest wait for an action server that the graph has told of [s]."""


class RclpyActions(RclpyOffers[CdrActionType]):
    """Actions of our node.

    Attributes:
        actions: gets what comes; set before the first turn of the loop.
    """

    kind = "action"

    actions: Ros2Actions

    # Actions of nodes

    def send_goal(self, name: str, action: CdrActionType, raw: bytes, ear: FarGoalEar) -> Callable[[], None]:
        """See `SendGoal`."""
        from rclpy.action import ActionClient  # noqa: PLC0415 - only with --ros2-domain

        found = self._node.types.find(action.name)
        with rclpy_errors():
            if name not in self._clients:
                self._clients[name] = ActionClient(self._node.library, found, self._node.far(name))
            message = read_cdr(raw, found.Goal)
        sent = _SentGoal(self._node, ear, self._loop)
        self._send(self._clients[name], message, sent, self._loop.time() + SERVER_PATIENCE)
        return sent.cancel

    def _send(self, client: RclpyObject, message: RclpyObject, sent: _SentGoal, end: float) -> None:
        """Send a goal as soon as its server is found."""
        if sent.ear.goal.is_done or self._node.is_stopped:
            return
        try:
            is_ready = client.server_is_ready()
        except Exception as error:  # noqa: BLE001 - of the library: its client has gone with the action, for example
            sent.ear.reject(f"the action cannot be used: {error!r:.200}")
            return
        if is_ready:
            self._node.run(lambda: sent.begin(client, message))
        elif self._loop.time() > end:
            sent.ear.reject("the action server does not answer")
        else:
            self._loop.call_later(READY_PERIOD, self._send, client, message, sent, end)

    # Actions of the bus

    def _provide(self, name: str, found: RclpyObject) -> RclpyObject:
        from rclpy.action import ActionServer  # noqa: PLC0415 - only with --ros2-domain

        goals = _ServedGoals(self, self._node, name, found)
        with rclpy_errors():
            return ActionServer(
                self._node.library,
                found,
                self._node.far(name),
                execute_callback=goals.never,
                goal_callback=goals.judge,
                handle_accepted_callback=goals.begin,
                cancel_callback=goals.cancel,
            )

    def _destroy(self, one: RclpyObject) -> None:
        one.destroy()


class _SentGoal:
    """A goal of the bus that a node carries out. Apart from `cancel`, its methods are for the thread that spins."""

    def __init__(self, node: RclpyNode, ear: FarGoalEar, loop: asyncio.AbstractEventLoop) -> None:
        self.ear = ear
        self._node = node
        self._loop = loop
        self._handle: RclpyObject = None
        self._is_canceled = False

    def begin(self, client: RclpyObject, message: RclpyObject) -> None:
        future = client.send_goal_async(message, feedback_callback=self._report)
        future.add_done_callback(self._go_on)

    def cancel(self) -> None:
        """Ask the node to cancel it, now or as soon as it has accepted it (for the loop)."""
        self._node.run(self._cancel)

    def _cancel(self) -> None:
        self._is_canceled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _report(self, message: RclpyObject) -> None:
        raw = write_cdr(message.feedback)
        self._node.inbox.put(lambda: self.ear.report(raw, self._loop.time()), len(raw))

    def _go_on(self, future: RclpyObject) -> None:
        handle = future.result() if future.exception() is None else None
        if handle is None or not handle.accepted:
            self._node.inbox.put(lambda: self.ear.reject("the goal was rejected by its node"))
            return
        self._handle = handle
        if self._is_canceled:
            handle.cancel_goal_async()
        handle.get_result_async().add_done_callback(self._end)

    def _end(self, future: RclpyObject) -> None:
        if future.exception() is not None:
            why = f"its node has sent no result: {future.exception()!r:.200}"
            self._node.inbox.put(lambda: self.ear.goal.fail(why))
            return
        answer = future.result()
        raw, status = write_cdr(answer.result), answer.status
        self._node.inbox.put(lambda: self.ear.end(status, raw), len(raw))


class _ServedGoals:
    """Goals of nodes for one action. The methods are for the thread that spins."""

    def __init__(self, actions: RclpyActions, node: RclpyNode, name: str, found: RclpyObject) -> None:
        self._actions = actions
        self._node = node
        self._name = name
        self._found = found
        self._judged: _ServedGoal | None = None
        self._goals: dict[bytes, _ServedGoal] = {}

    def never(self, _handle: RclpyObject) -> RclpyObject:
        """Stand for a function that rclpy wants to have; each goal brings its own at its end."""
        return self._found.Result()

    def judge(self, request: RclpyObject) -> RclpyObject:
        """Accept a goal or not, as the bus says."""
        from rclpy.action import GoalResponse  # noqa: PLC0415 - only with --ros2-domain

        raw = write_cdr(request)
        one = self._judged = _ServedGoal(self._node, self._found)
        self._node.inbox.put(lambda: one.take(self._actions.actions, self._name, raw), len(raw))
        return GoalResponse.ACCEPT if one.wait() else GoalResponse.REJECT

    def begin(self, handle: RclpyObject) -> None:
        """Let the progress of an accepted goal be told."""
        one = self._judged
        assert one is not None  # rclpy has just called `judge` for this goal
        key = bytes(handle.goal_id.uuid)
        self._goals[key] = one
        one.on_end = lambda: self._goals.pop(key, None)
        self._node.inbox.put(lambda: one.begin(handle))

    def cancel(self, handle: RclpyObject) -> RclpyObject:
        """Pass on that a node wants a goal to end."""
        from rclpy.action import CancelResponse  # noqa: PLC0415 - only with --ros2-domain

        one = self._goals.get(bytes(handle.goal_id.uuid))
        if one is None:
            return CancelResponse.REJECT
        self._node.inbox.put(one.cancel)
        return CancelResponse.ACCEPT


class _ServedGoal:
    """A goal of a node that a participant of the bus carries out; see `NodeGoalEar`.

    Attributes:
        on_end: called at its end.
    """

    def __init__(self, node: RclpyNode, found: RclpyObject) -> None:
        self.on_end: Callable[[], object] = lambda: None
        self._node = node
        self._found = found
        self._goal: Goal | None = None
        self._handle: RclpyObject = None
        self._waiting: list[Callable[[], None]] = []
        self._judged = threading.Event()
        self._is_late = False

    def wait(self) -> bool:
        """Return whether the bus has accepted it (for the thread that spins)."""
        self._is_late = not self._judged.wait(VERDICT_PATIENCE)
        return self._goal is not None and not self._is_late

    def take(self, actions: Ros2Actions, name: str, raw: bytes) -> None:
        """Ask the bus (this and all below is for the loop)."""
        self._goal = None if self._is_late else actions.send(name, raw, self)
        self._judged.set()
        if self._is_late and self._goal is not None:
            self._goal.abandon()

    def begin(self, handle: RclpyObject) -> None:
        """Tell what has been told so far."""
        self._handle = handle
        for work in self._waiting:
            work()
        self._waiting.clear()

    def cancel(self) -> None:
        """Ask the provider to end it."""
        if self._goal is not None:
            self._goal.cancel()

    def report(self, raw: bytes) -> None:
        """See `NodeGoalEar`."""
        self._do(lambda: self._handle.publish_feedback(read_cdr(raw, self._found.Feedback)))

    def end(self, status: int, raw: bytes) -> None:
        """See `NodeGoalEar`."""
        self._do(lambda: self._handle.execute(partial(self._finish, status, raw)))
        self.on_end()

    def _do(self, work: Callable[[], None]) -> None:
        def run() -> None:
            if not self._node.is_stopped:
                work()

        if self._handle is not None:
            self._node.run(run)
        elif len(self._waiting) < 1_000:  # noqa: PLR2004 - much more than fits between acceptance and beginning
            self._waiting.append(lambda: self._node.run(run))

    def _finish(self, status: int, raw: bytes, handle: RclpyObject) -> RclpyObject:
        """Set the status at the end, and return the result (for the thread that spins)."""
        ends: dict[int, RclpyObject] = {GoalStatus.SUCCEEDED: handle.succeed, GoalStatus.CANCELED: handle.canceled}
        with suppress(Exception):  # no change that the library allows, such as cancelled without being asked to
            ends.get(status, handle.abort)()
        if handle.is_active:
            handle.abort()
        return read_cdr(raw, self._found.Result)
