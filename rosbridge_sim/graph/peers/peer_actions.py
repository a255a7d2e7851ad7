"""Actions of one client: the goals that it sends and the actions that it provides."""

from __future__ import annotations

import re

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.actions import Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.participant import decode_body, resolve
from rosbridge_sim.graph.peers.peer_base import CheckRoom, PeerBase, needed_type
from rosbridge_sim.graph.peers.pending_work import Offers, PendingWork
from rosbridge_sim.protocol import ops
from rosbridge_sim.schema.message import Message


class PeerActions(Offers[Goal]):
    """The actions of one client."""

    def __init__(self, peer: PeerBase, check_room: CheckRoom) -> None:
        super().__init__(peer, check_room, Goal.fail)
        self._actions = peer.bus.actions
        self._sent: dict[tuple[str, ops.Id], Goal] = {}

    def advertise(self, op: ops.AdvertiseAction, _now: float) -> None:
        """Offer an action."""
        self._peer.policy.check_offer(op.action)
        self._check_room(None)
        provided = PendingWork[Goal]("action_goal", op.action)
        ids: dict[Goal, str] = {}

        def take(goal: Goal) -> None:
            nonlocal ids
            if provided.tidy():
                ids = {goal: goal_id for goal_id, goal in provided.items()}
            if len(goal.action.goals) > self._actions.max_goals:  # including this one
                text = f"Action {op.action} has {self._actions.max_goals} goals under way already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            goal_id = ids[goal] = provided.add(goal)
            args = Message(goal.action.type.goal, goal.request)
            self._peer.session.say(
                "send_action_goal", {"args": args}, id=goal_id, action=op.action, action_type=op.type, feedback=True
            )

        def cancel(goal: Goal) -> None:
            goal_id = ids.get(goal)
            if goal_id is not None:
                self._peer.session.say("cancel_action_goal", {}, id=goal_id, action=op.action)

        action = self._actions.provide(self._peer, op.action, needed_type(op), take, cancel)
        self._provided[action.name] = provided

    def unadvertise(self, op: ops.UnadvertiseAction, _now: float) -> None:
        """Stop offering an action."""
        self._actions.withdraw(self._peer, op.action)
        self._provided.pop(resolve(op.action), None)

    def send_goal(self, op: ops.SendActionGoal, _now: float) -> None:
        """Send a goal; a mistake ends the goal."""
        key = (op.action, op.id)

        def on_feedback(values: Message) -> None:
            self._peer.session.say("action_feedback", {"values": values}, op.fragment_size, action=op.action, id=op.id)

        def on_outcome(outcome: GoalOutcome) -> None:
            self._sent.pop(key, None)
            values = outcome.values
            if outcome.reason is not None:
                values = f"{values}{self._peer.suggest(outcome.reason, op)}"
                self._peer.note(outcome.reason, values, op)
            end = {"action": op.action, "status": outcome.status, "result": outcome.is_ok, "id": op.id}
            if isinstance(values, Message):
                self._peer.session.say("action_result", {"values": values}, op.fragment_size, **end)
            else:
                self._peer.session.say("action_result", {}, op.fragment_size, values=values, **end)

        try:
            self._peer.policy.check_goal(op.action)
            if op.action_type:
                known = self._actions.by_name.get(resolve(op.action))
                if known is not None and self._peer.bus.store.canonical(op.action_type) != known.type.name:
                    text = f"Action {op.action} is of type {known.type.name}, not {op.action_type}"
                    raise GraphError(text, reason=Reason.TYPE_CONFLICT)
        except PeerError as error:
            self._peer.refuse(op, str(error), error.reason)
            return
        report = on_feedback if op.feedback else None
        goal = self._actions.send(self._peer, op.action, op.args, on_outcome, report, uuid=_read_uuid(op.id))
        if goal is not None and op.id is not None:
            self._sent[key] = goal

    def cancel_goal(self, op: ops.CancelActionGoal, _now: float) -> None:
        """Cancel a goal. An unknown or ended goal is not a mistake, as in rosbridge_suite."""
        goal = self._sent.get((op.action, op.id))
        if goal is not None:
            goal.cancel()

    def report(self, op: ops.ActionFeedback, now: float) -> None:
        """Pass on feedback for a goal of which this client is the provider."""
        goal = self._find_goal(op)
        if goal is not None:
            goal.report(decode_body(goal.action.type.feedback, op.values, self._peer.bus.stamp_ns), now)

    def end_goal(self, op: ops.ActionResult, _now: float) -> None:
        """End a goal of which this client is the provider."""
        goal = self._find_goal(op)
        if goal is None:
            return
        result_type = goal.action.type.result
        if not op.result:
            try:
                values = decode_body(result_type, op.values, self._peer.bus.stamp_ns)
            except PeerError:  # a failed provider may send any value
                values = result_type.default()
            goal.end(GoalStatus.ABORTED, values)
            return
        try:
            status = GoalStatus.SUCCEEDED if op.status is None else _read_status(op.status)
            values = decode_body(result_type, op.values, self._peer.bus.stamp_ns)
        except PeerError as error:
            goal.fail(str(error))
            raise
        goal.end(status, values)

    def _find_goal(self, op: ops.ActionFeedback | ops.ActionResult) -> Goal | None:
        """Return the goal of this provider with that id; None if no caller waits for it."""
        provided = self._provided.get(resolve(op.action))
        if provided is None:
            text = f"Action {op.action} has not been advertised via rosbridge."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        goal = provided.get(op.id)
        if goal is None:
            text = f"No goal of {op.action} with this id is in progress"
            self._peer.session.remark("warning", text, op.id)
            self._peer.note(Reason.STRAY_ANSWER, text, op)
        return None if goal is None or goal.is_done else goal

    def forget(self) -> None:
        """Forget all actions and goals; the bus removes its own entries itself."""
        super().forget()
        self._sent.clear()


def _read_uuid(op_id: ops.Id) -> bytes:
    """Return the UUID that an id is or ends with; empty if there is none."""
    match = _UUID.search(op_id) if isinstance(op_id, str) else None
    return b"" if match is None else bytes.fromhex(match[0].replace("-", ""))


_UUID = re.compile(r"[0-9a-fA-F]{8}(?:-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}\Z")


def _read_status(number: int) -> GoalStatus:
    try:
        return GoalStatus(number)
    except ValueError:
        text = f"action_result: {number} is no status of action_msgs/GoalStatus"
        raise GraphError(text, reason=Reason.WRONG_VALUE) from None
