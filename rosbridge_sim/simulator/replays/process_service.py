"""The service that takes replay commands: `/Morai_SimProc`."""

from __future__ import annotations

import logging
from functools import partial
from typing import Any

from rosbridge_sim.errors import DocumentError, FieldError, GraphError
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.plain.reading import answering
from rosbridge_sim.simulator.replays.playback_actors import ALL_TARGETS
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.process_status import ProcessStatus
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Recordings
from rosbridge_sim.simulator.replays.replay_command import ReplayCommand, ReplayResult, read_command
from rosbridge_sim.simulator.replays.replayed_plans import without_denied_plans
from rosbridge_sim.simulator.replays.state_machine import ReplayState

_log = logging.getLogger("rosbridge_sim.replay")


class ProcessService:
    """Provider of `/Morai_SimProc`: reads a command, loads its recording, and answers when it is carried out."""

    def __init__(self, process: ReplayProcess, status: ProcessStatus, recordings: Recordings | None) -> None:
        """No command has come yet.

        Args:
            process: carries out the commands.
            status: publishes how the commands end.
            recordings: reads recordings; None where there are none.
        """
        self._process, self._context, self._playback = process, process.context, process.playback
        self._status = status
        self._recordings = recordings
        self._loading: Call | None = None  # its recording is being read
        self._make_result = process.context.maker("morai_msgs/MoraiSrvResponse", "result")

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service."""
        bindings.provide("Morai_SimProc", "MoraiSimProcSrv", self._command)

    def forget(self, why: str = "The simulation was reset") -> None:
        """Refuse the command whose recording is being read, because the world has been reset or restored."""
        if self._loading is not None:
            loading, self._loading = self._loading, None
            loading.refuse(why)

    def _command(self, call: Call, now: float) -> None:
        if self._context.stepper.is_moving:
            raise GraphError("the world is moving")
        self._status.begin_command()
        request: Any = call.request
        try:
            command = read_command(request.request)
        except FieldError as error:
            self._refuse(call, ReplayResult.REFUSED, str(error), now)
            return
        if self._loading is not None:
            self._refuse(call, ReplayResult.REFUSED, "a recording is being read", now)
        elif command.name is None:
            self._tune(call, command, now)
        elif self._recordings is None:
            self._refuse(call, ReplayResult.NOT_LOADED, "this simulator has no folder with recordings", now)
        else:
            self._loading = call
            reading = RecordingBuilder(command.name, self._context.convert)
            self._recordings.read(command.name, reading, answering(call.refuse, partial(self._take, call, command)))

    def _take(self, call: Call, command: ReplayCommand, outcome: Recording | DocumentError, now: float) -> None:
        """Take a recording that has been read, or the error that prevented it."""
        if self._loading is not call:
            return
        self._loading = None
        if call.is_done:
            _log.info("%s was read, but its caller has left: it is not replayed", command.name)
            self._status.announce(now)
        elif isinstance(outcome, DocumentError):
            self._refuse(call, ReplayResult.NOT_LOADED, str(outcome), now)
        else:
            self._load(call, command, outcome, now)

    def _load(self, call: Call, command: ReplayCommand, recording: Recording, now: float) -> None:
        playback = self._playback
        recording = without_denied_plans(recording, call.caller)
        targets = ALL_TARGETS if command.targets is None else command.targets
        why = playback.why_unusable(recording, targets)
        if why:
            self._refuse(call, ReplayResult.UNUSABLE, f"{recording.name}: {why}", now)
            return
        start_ns = command.start_ns or 0
        if start_ns > recording.duration_ns:
            self._refuse(call, ReplayResult.REFUSED, _beyond(recording), now)
            return
        for note in [*recording.notes, *playback.notes_on(recording, targets)]:
            call.caller.notify(
                "info", f"{recording.name}: {note}"
            )  # info and not warning: the command is carried out, and the caller made no mistake
            _log.warning("%s: %s", recording.name, note)
        seconds = recording.duration_ns / 1e9
        _log.info("%s: %.2f s are replayed for %s", recording.name, seconds, call.caller.name)
        playback.choose(recording, targets, start_ns=start_ns, speed=command.speed or 1)
        self._obey(call, command, now)

    def _tune(self, call: Call, command: ReplayCommand, now: float) -> None:
        """Carry out a command that names no recording: it is for the one that moves the world, if any."""
        playback = self._playback
        if self._process.state in {ReplayState.REPLAYING, ReplayState.AT_END}:
            targets = playback.targets if command.targets is None else command.targets
            why = playback.why_unusable(playback.recording, targets)
            if command.start_ns is not None and command.start_ns > playback.recording.duration_ns:
                why = _beyond(playback.recording)
            if why:
                self._refuse(call, ReplayResult.REFUSED, why, now)
                return
            playback.targets, playback.speed = targets, command.speed or playback.speed
            if command.start_ns is not None:
                playback.seek(command.start_ns)
        self._obey(call, command, now)

    def _obey(self, call: Call, command: ReplayCommand, now: float) -> None:
        self._status.is_held = True  # intermediate states are not published
        why = ""
        try:
            for event in command.events:
                why = why or self._process.happen(event, now).why
        except DocumentError as error:  # there is no room for the scenario that is loaded again
            why = str(error)
        finally:
            self._status.is_held = False
        if why:
            self._refuse(call, ReplayResult.REFUSED, why, now)
            return
        _log.debug("%s by %s: %s", command, call.caller.name, self._process.state.name)
        self._end(call, ReplayResult.DONE, now)

    def _refuse(self, call: Call, result: ReplayResult, why: str, now: float) -> None:
        call.caller.notify("error", f"{call.service.name}: {why}")
        _log.warning("%s refused: %s", call.service.name, why)
        self._end(call, result, now)

    def _end(self, call: Call, result: ReplayResult, now: float) -> None:
        self._status.end_command(result, now)
        call.respond(self._make_result(result is ReplayResult.DONE))


def _beyond(recording: Recording) -> str:
    return f"start_time: {recording.name} lasts {recording.duration_ns // 1_000_000} ms"
