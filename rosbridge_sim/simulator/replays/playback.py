"""The recording that moves the world, and the position in it that the next frame shows."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.simulator.egos.ego_registry import EgoRegistry
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.replays.playback_actors import ALL_TARGETS, EGO, PlaybackActors
from rosbridge_sim.simulator.replays.recorded_drive import MAX_STAMP, RecordedMoment, Recording
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.state.world import STEP_NS, World

MAX_MISSING_TOLD: Final = 10
"""Egos that the world does not have of which the caller is told, a line each."""


class Playback:
    """A recording that is shown in the world, from a position on, at a speed.

    Attributes:
        recording: an empty one while none moves the world.
        targets: entities that it moves: a sum of EGO, VEHICLES and PEDESTRIANS.
        speed: recorded time for each simulated time.
        is_over: its last moment has been shown.
        actors: what it moves.
        shown_ns: the position that the world shows [ns].
    """

    def __init__(self, world: World, scene: Scene, egos: EgoRegistry) -> None:
        """Start with an empty recording.

        Args:
            scene: gives ids to the entities of a recording.
            egos: those that a recording may move.
        """
        self._egos = egos
        self.actors = PlaybackActors(world, scene, egos.find)
        self.choose(Recording(""))

    def choose(self, recording: Recording, targets: int = ALL_TARGETS, *, start_ns: int = 0, speed: int = 1) -> None:
        """Take another recording; the world does not change before `enter`.

        Args:
            start_ns: first position, since the recording's first stamp [ns].
            speed: recorded time for each simulated time.
        """
        self.recording = recording
        self.targets = targets
        self.speed = speed
        self.seek(start_ns)

    def seek(self, start_ns: int) -> None:
        """Set the position; `rewind` comes back to it.

        Args:
            start_ns: position, since the recording's first stamp [ns].
        """
        self._start_ns = self._position_ns = self.shown_ns = start_ns
        self.is_over = False

    # The world; `show_frame` within a step, all others between two frames

    def enter(self) -> None:
        """Let the recording move its targets; `leave` gives them back."""
        self.actors.enter(self.recording.egos, self.targets, has_objects=self.recording.objects is not None)
        self.show()

    def leave(self) -> None:
        """Restore the world as it was before `enter`."""
        self.actors.leave()
        self._egos.forget_statuses()

    def retarget(self) -> None:
        """Follow a change of `targets`."""
        self.actors.retarget(self.recording.egos, self.targets, has_objects=self.recording.objects is not None)
        self.show()

    def rewind(self) -> None:
        """Go back to the last start."""
        self.seek(self._start_ns)
        self.show()

    def show(self) -> None:
        """Show the position at once. It is a jump: nothing collides on the way there."""
        self.actors.show(self._moment())
        self._egos.forget_statuses()

    def show_frame(self) -> None:
        """Show the position with the frame that is being computed, and go on by one frame."""
        self.actors.show(self._moment())
        self.shown_ns = min(self._position_ns, self.recording.duration_ns)
        self.is_over = self._position_ns >= self.recording.duration_ns
        self._position_ns += STEP_NS * self.speed

    def _moment(self) -> RecordedMoment:
        return self.recording.moment(min(self._position_ns, self.recording.duration_ns))

    # Snapshots

    def save_state(self) -> PlainData:
        """Return the position and what is moved, without the recording."""
        return (*(self.targets, self.speed, self._start_ns, self._position_ns, self.is_over), self.actors.save_state())

    def load_state(self, data: PlainData, recording: Recording) -> None:
        """Become what was saved; the world and the egos have been restored.

        Args:
            data: from `save_state`.
            recording: the one that moved the world; an empty one for none.

        Raises:
            ValueError: it is no such data.
            DocumentError: the same.
        """
        targets, speed, start_ns, position_ns, is_over, actors = data
        numbers = (targets, speed, start_ns, position_ns)
        if not all(type(number) is int and 0 <= number < MAX_STAMP for number in numbers) or type(is_over) is not bool:
            raise ValueError("replay: expected targets, a speed and positions")
        if not recording.is_empty and start_ns > recording.duration_ns:
            raise ValueError("replay: expected a start within the recording")
        self.actors.load_state(actors)
        if not self.actors.indices <= set(recording.egos):
            raise ValueError("replay: expected egos of the recording")
        self.recording, self.targets, self.speed = recording, targets, speed
        self._start_ns, self._position_ns, self.is_over = start_ns, position_ns, is_over
        # The last frame showed the position before, if it showed any since the start.
        last_ns = position_ns if position_ns == start_ns else position_ns - STEP_NS * speed
        self.shown_ns = 0 if recording.is_empty else min(last_ns, recording.duration_ns)

    # Questions before a recording is chosen

    def why_unusable(self, recording: Recording, targets: int) -> str:
        """Return the reason why a recording cannot move any of the targets.

        Args:
            targets: a sum of EGO, VEHICLES and PEDESTRIANS.

        Returns:
            A text for the client; empty if it can.
        """
        if recording.is_empty:
            return "it holds no ego and no objects that can be replayed"
        has_ego = any(self._egos.find(index) is not None for index in recording.egos)
        held = (EGO if has_ego else 0) | (ALL_TARGETS & ~EGO if recording.objects is not None else 0)
        return "" if held & targets else "it holds none of the chosen targets"

    def notes_on(self, recording: Recording, targets: int) -> list[str]:
        """Return remarks for the user about the egos of a recording.

        Args:
            targets: a sum of EGO, VEHICLES and PEDESTRIANS.

        Returns:
            A line each; empty if there are none.
        """
        if not targets & EGO:
            return []
        if not recording.egos:
            return ["it holds no ego: only the objects are replayed"]
        missing = [index for index in recording.egos if self._egos.find(index) is None]
        notes = [
            f"it holds an ego {index}, but the world has none with this number: it is left out"
            for index in missing[:MAX_MISSING_TOLD]
        ]
        if len(missing) > MAX_MISSING_TOLD:
            notes.append(f"so are {len(missing) - MAX_MISSING_TOLD} more egos")
        if any(not track.has_place for track in recording.egos.values()):
            notes.append("it holds no position of the ego: objects and pedals are replayed")
        return notes
