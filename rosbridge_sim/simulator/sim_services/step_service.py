"""The component of `/sim/step`: many ticks, commands for the egos, and what came of it, in one call.

A step is one tick of the master's time step. The commands of a step are carried out before its first frame, behind
those that wait for that frame already: as if they had come by `/SyncModeCtrlCmd` for the next frame, just before the
tick. One command for all steps is as many calls with that command. So n steps give the same world and the same bytes
on every topic as n times the two services.

The first steps are done within the call, the others in turns (see `SyncDriver`); the caller is held and answered after
the last one. What others command meanwhile waits for the frames behind the call. Conditions to stop are looked at
after each frame, and end the call with the step in which they are met.

Topics. A topic that goes out with each frame is asked once, at the end; a message that went out to listeners is taken
as it is. What is *sampled* at a rate (GPS, IMU) is the message of the last frame of the call that was due for one.
What is kept for those who come late is the message that is kept. Nothing of this is published. A client that may not
subscribe to a topic may not ask for it here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason
from rosbridge_sim.graph.participant import Participant, resolve
from rosbridge_sim.graph.policy import is_allowed
from rosbridge_sim.graph.topics_services import BodyLimits, Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.bus.publisher_kinds import LatchedPublisher, PeriodicPublisher
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.tick_calls import TickResult
from rosbridge_sim.simulator.scene.scene_commands import ControlEgo, SceneCommand
from rosbridge_sim.simulator.sim_services.step_events import StopWatch, has_conditions
from rosbridge_sim.suggestions import hint

MAX_STEPS: Final = 1_000
"""Steps of one call: 20 s of simulated time at the shortest time step, and up to 1,000 s at the longest."""

_LIMITS: Final = BodyLimits(num_bytes=2 * 2**20, containers=10_100, texts=100_000, values=100_000)
"""Of a request with 10,000 commands, such as those of ten egos for a thousand steps."""

MAX_TOPICS: Final = 32
"""Topics in one answer: more than the first ego and the world have."""

INTERRUPTED: Final = "interrupted"
"""`stopped_by` of a call that another event has ended: a pause, a stop, a reset, the loss of the master."""


class _Commands(NamedTuple):
    """The commands of one ego.

    Attributes:
        commands: one for all steps, or one for each.
    """

    ego: Ego
    commands: Sequence[SceneCommand]

    def at(self, i: int) -> SceneCommand:
        """Return the command of a step, counted from 0."""
        return self.commands[i if len(self.commands) > 1 else 0]


@dataclass(slots=True)
class _Sample:
    """A topic whose last message is wanted.

    Attributes:
        name: as the caller has it.
        publisher: of the simulator.
        message: the last one so far, of a topic that is sampled.
    """

    name: str
    publisher: PeriodicPublisher | LatchedPublisher
    message: Message | None = None

    @property
    def is_sampled(self) -> bool:
        """Return whether not every frame has a message."""
        return isinstance(self.publisher, PeriodicPublisher) and self.publisher.is_sampled


class _Plan(NamedTuple):
    """A request that was read and checked.

    Attributes:
        num: steps.
        commands: for each ego that has any.
        samples: the topics that are wanted.
        watch: looks at the conditions to stop; None where there are none.
    """

    num: int
    commands: Sequence[_Commands]
    samples: Sequence[_Sample]
    watch: StopWatch | None


class _StepCall:
    """One call that is being carried out; see `Steps`.

    Attributes:
        num_left: steps that are still to be done, with one that has begun.
        plan: what was asked for.
    """

    def __init__(self, service: StepService, call: Call, plan: _Plan) -> None:
        self.num_left = plan.num
        self.num_done = 0
        self.plan = plan
        self._service = service
        self._call = call
        self._sampled = [sample for sample in plan.samples if sample.is_sampled]
        self._is_plain = not (plan.commands or plan.watch or self._sampled)
        self._hook = self._after_frame if plan.watch is not None or self._sampled else None
        self._is_hooked = False
        self._taken: list[tuple[PeriodicPublisher, Callable[[Message], None]]] = []

    @property
    def num_at_once(self) -> int:
        """Return how many steps need no care between them: all if there is nothing to command or to look at."""
        return self.num_left if self._is_plain else 1

    @property
    def is_wanted(self) -> bool:
        """Return whether a client waits for the answer."""
        return not self._call.is_done

    def before_tick(self) -> None:
        """Have the commands of a step carried out before its first frame."""
        if self._is_plain:
            return
        context, plan = self._service.context, self.plan
        for commands in plan.commands:
            commands.ego.commander = self._call.caller
            context.sync.enter(commands.at(self.num_done), context.world.frame)
        if plan.watch is not None:
            plan.watch.begin_tick()
        if self._hook is not None:
            context.hooks.after_frame.append(self._hook)
            self._is_hooked = True
        self._take()

    def after_ticks(self, num: int) -> bool:
        """Count steps as done; return whether a condition to stop is met."""
        self.num_done += num
        self.num_left -= num
        self._unhook()
        return self.plan.watch is not None and bool(self.plan.watch.met)

    def _take(self) -> None:
        """Have the messages made that come behind a frame, and keep the last one of each topic."""
        if self._taken:
            return
        for sample in self._sampled:
            if isinstance(sample.publisher, PeriodicPublisher):
                take = partial(setattr, sample, "message")
                self._taken.append((sample.publisher, take))
                sample.publisher.takers.append(take)

    def _unhook(self) -> None:
        if self._hook is not None and self._is_hooked:
            self._is_hooked = False
            self._service.context.hooks.after_frame.remove(self._hook)

    def end(self, result: TickResult) -> None:
        """Answer the caller."""
        self._unhook()  # a step that was interrupted in its middle has no `after_ticks`
        for publisher, take in self._taken:
            publisher.takers.remove(take)
        self._taken = []
        if self._call.is_done:  # given up, or the caller has left
            return
        self._service.answer(self._call, self, result)

    def _after_frame(self, _now: float) -> None:
        """Look at the frame that was just published."""
        context = self._service.context
        if self.plan.watch is not None:
            self.plan.watch.look()
        for sample in self._sampled:
            publisher = sample.publisher
            if isinstance(publisher, PeriodicPublisher) and publisher.num_due(context.world.frame):
                sample.message = context.publishers.sample(publisher) or sample.message


class StepService(Component):
    """The component of `/sim/step`. It holds no state: a call that waits holds its own.

    Attributes:
        context: of the simulator.
    """

    def __init__(self, context: SimulatorContext) -> None:
        self.context = context
        self._make_sample = context.maker("rosbridge_sim_msgs/TopicSample", "topic type message")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services that exist once, not for each ego."""
        bindings.provide("sim/step", "rosbridge_sim_msgs/Step", self._step, limits=_LIMITS)

    def _step(self, call: Call, now: float) -> None:
        request: Any = call.request
        context = self.context
        if context.stepper.is_moving:  # a listener of a tick's topics asks from within
            raise GraphError(f"{call.service.name}: a tick is in progress", reason=Reason.NOT_NOW)
        try:
            steps = self._read(request, call)
        except PeerError as error:
            call.explain(error, error.reason)
            self._respond(call, message=str(error))
            return
        for sample in steps.plan.samples:
            if sample.publisher.topic is not None:
                context.projection_import.prepare(sample.publisher.topic)
        context.sync_driver.ask_steps(request.user_id, steps, call.caller, now)

    def answer(self, call: Call, steps: _StepCall, result: TickResult) -> None:
        """Answer a call that has ended (for the call itself)."""
        context = self.context
        if context.failure.why is not None:
            call.refuse(context.failure.why)
            return
        stopped_by = steps.plan.watch.met if steps.plan.watch is not None else ""
        if not result.is_accepted:
            call.explain(result.why, result.reason, "warning")
            stopped_by = stopped_by or (INTERRUPTED if steps.num_done else "")
        self._respond(
            call,
            result=result.is_accepted,
            message=result.why,
            steps=steps.num_done,
            stopped_by=stopped_by,
            topics=[self._write(sample, num_done=steps.num_done) for sample in steps.plan.samples],
        )

    def _respond(self, call: Call, **fields: object) -> None:
        context = self.context
        egos = [ego.status() for ego in context.egos if ego.is_there]
        call.respond(frame=context.world.frame, egos=egos, **fields)

    def _write(self, sample: _Sample, *, num_done: int) -> Struct:
        """Return the last message of a topic as the answer has it.

        Raises:
            EncodingError: it cannot be written.
        """
        publisher = sample.publisher
        message = sample.message
        if not sample.is_sampled and (num_done or isinstance(publisher, LatchedPublisher)):
            message = self.context.publishers.sample(publisher)
        text = "" if message is None else message.json.decode()
        return self._make_sample(sample.name, self.context.bus.store.spelled(publisher.type_name, "msg"), text)

    # The request

    def _read(self, request: Any, call: Call) -> _StepCall:  # noqa: ANN401 - a generated struct
        """Check the whole request.

        Raises:
            PeerError: what is wrong with it. Nothing has changed.
        """
        if not 1 <= request.n <= MAX_STEPS:
            raise FieldError(f"n: expected 1 to {MAX_STEPS:,} steps, got {request.n}")
        commands = self._read_commands(request, call)
        samples = self._find_topics(request.topics, call.caller)
        watch = self._watch(request) if has_conditions(request) else None
        return _StepCall(self, call, _Plan(request.n, commands, samples, watch))

    def _read_commands(self, request: Any, call: Call) -> list[_Commands]:  # noqa: ANN401 - as above
        egos: dict[Ego, _Commands] = {}
        name, notify = call.service.name, call.caller.notifier()
        for i, entry in enumerate(request.commands):
            ego = self.context.egos.find(entry.ego)
            if ego is None:
                there = ", ".join(str(one.index) for one in self.context.egos)
                raise FieldError(f"commands[{i}].ego: expected the number of an ego, one of {there}; got {entry.ego}")
            if ego in egos:
                raise FieldError(f"commands[{i}].ego: ego {ego.index} is named twice")
            num = len(entry.commands)
            if num not in {1, request.n}:
                raise FieldError(f"commands[{i}].commands: expected 1 or n = {request.n} commands, got {num}")
            read, index, uid = self.context.convert.control, ego.index, ego.uid
            actions = [ControlEgo(index, uid, read(command), has_capture=False) for command in entry.commands]
            egos[ego] = _Commands(ego, [SceneCommand(action, name, notify) for action in actions])
            if ego.moved_by:
                why = f"{name}: commands move nothing while a {ego.moved_by} moves ego {index}"
                self.context.warnings.warn(call.caller, why)
        return list(egos.values())

    def _find_topics(self, names: Sequence[str], caller: Participant) -> list[_Sample]:
        if len(names) > MAX_TOPICS:
            raise FieldError(f"topics: expected at most {MAX_TOPICS} names, got {len(names)}")
        if len(set(names)) != len(names):
            raise FieldError("topics: a name stands there twice")
        samples = []
        for i, name in enumerate(names):
            publisher = self.context.publishers.find(resolve(name))
            if publisher is None:
                types = self.context.publishers.types
                known = [one for one, kind in types if is_allowed(caller.check_subscribe, one, kind)]
                raise GraphError(
                    f"topics[{i}]: the simulator has no topic {name[:80]!r}{hint(name, known)}",
                    reason=Reason.UNKNOWN_TOPIC,
                )
            try:
                caller.check_subscribe(name, publisher.type_name)
            except GraphError as error:
                raise GraphError(f"topics[{i}]: {error}", reason=error.reason) from None
            samples.append(_Sample(name, publisher))
        return samples

    def _watch(self, request: Struct) -> StopWatch:
        egos = self.context.egos
        return StopWatch(request, self.context.world, lambda: [ego.uid for ego in egos if ego.is_there])
