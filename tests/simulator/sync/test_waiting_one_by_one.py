"""Ticks and commands that wait, in any order, against a list of the frames that are owed."""

from __future__ import annotations

import random
from dataclasses import dataclass

import pytest

from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.simulator.sync.sync_table import SyncState

ME = "me"


@dataclass
class Command:
    """A command that waits.

    Attributes:
        named: the frame that it asked for.
        before: the owed frames before which it came: each is a number of its own.
        is_ready: it can be carried out.
    """

    named: int
    before: list[int]
    is_ready: bool


class Model:
    """A world that owes frames, each with a number, in ticks; and commands, by name.

    Attributes:
        frame: of the world.
        ticks: the frames of each tick that waits, those that are left.
        has_begun: some frames of the first tick have been computed.
        num_prepared: ticks that were prepared.
    """

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)  # noqa: S311 - no secret
        self.sync: Sync[str] = Sync()
        self.sync.start(ME, 40, ME, 0.0)
        self.sync.hooks.move = self.compute
        self.frame, self.num_owed, self.num_prepared = 10, 0, 0
        self.ticks: list[list[int]] = []
        self.commands: dict[str, Command] = {}
        self.has_begun = False

    @property
    def owed(self) -> list[int]:
        return [number for tick in self.ticks for number in tick]

    def due(self, command: Command) -> int:
        """The frame before which it is carried out: behind those before it that are still owed."""
        left = len(set(command.before) & set(self.owed))
        return max(command.named, self.frame + left + 1)

    def compute(self, num_frames: int, _now: float) -> int:
        """Compute some of these frames, or all."""
        num = self.chance.choice([num_frames, self.chance.randint(1, num_frames)])
        for _ in range(num):
            expected = [name for name, command in self.commands.items() if self.due(command) == self.frame + 1]
            order = {name: i for i, (_, name) in enumerate(self.sync.waiting())}
            assert self.sync.due(self.frame + 1) == sorted(expected, key=order.__getitem__)
            for name in expected:
                del self.commands[name]
            self.frame += 1
            self.ticks[0].pop(0)
            self.has_begun = bool(self.ticks[0])
            if not self.has_begun:
                self.ticks.pop(0)
        return num

    def act(self) -> None:
        sync, chance = self.sync, self.chance
        what = chance.randrange(11)
        if what == 0:
            sync.start(ME, 20 * chance.randint(1, 4), ME, 0.0)
        elif what == 1 and len(self.ticks) < 6:
            num = chance.randint(1, 3)
            for _ in range(num):
                self.ticks.append([self.num_owed + i for i in range(sync.num_frames)])
                self.num_owed += sync.num_frames
            sync.step(ME, num, ME, 0.0, on_wait=lambda: None)
        elif what in {2, 3}:
            name, is_ready = f"c{chance.random()}", chance.random() < 0.8
            named = chance.choice([0, self.frame + chance.randint(-2, 20)])
            self.commands[name] = Command(named, self.owed, is_ready)
            assert sync.submit(name, named, self.frame, ME, 0.0, is_ready=is_ready).is_accepted
        elif what == 4:
            for name, command in self.commands.items():
                command.is_ready = True
                sync.ready(name)
        elif what == 5 and self.ticks:
            num = chance.randint(1, len(self.ticks))
            del self.ticks[:num]
            self.has_begun = False
            sync.give_up(num, 0.0)
        elif what == 6 and chance.random() < 0.3:
            self.ticks, self.has_begun = [], False
            sync.pause(0.0)
            sync.resume(0.0)
        else:
            self.turn(chance.randint(1, max(len(self.ticks), 1)))

    def turn(self, most_ticks: int) -> None:
        """Carry out ticks, unless the first one waits for a command that is not ready."""
        unready = [self.due(command) for command in self.commands.values() if not command.is_ready]
        is_early = bool(self.ticks) and any(due <= self.frame + len(self.ticks[0]) for due in unready)
        may_move = bool(self.ticks) and not is_early
        assert self.sync.has_turn(self.frame) == may_move
        frame, has_begun, prepared = self.frame, self.has_begun, self.num_prepared
        moved = self.sync.take_turn(self.frame, 0.0, prepare=self._prepare, most_ticks=most_ticks)
        assert moved == self.frame - frame
        assert (moved > 0) == may_move
        assert self.num_prepared == prepared + (may_move and not has_begun)

    def _prepare(self) -> None:
        self.num_prepared += 1

    def check(self) -> None:
        sync = self.sync
        assert {name: due for due, name in sync.waiting()} == {
            name: self.due(command) for name, command in self.commands.items()
        }
        assert [due for due, _ in sync.waiting()] == sorted(due for due, _ in sync.waiting())
        assert (sync.num_ticks, sync.is_in_tick) == (len(self.ticks), self.has_begun)
        assert sync.state is (SyncState.WAITING if self.ticks else SyncState.LED)
        assert sync.has_unready == any(not command.is_ready for command in self.commands.values())


@pytest.mark.parametrize("seed", range(12))
def test_commands_are_carried_out_behind_the_frames_that_were_owed_when_they_came(seed: int) -> None:
    model = Model(seed)
    for _ in range(200):
        model.act()
        model.check()
    assert model.frame > 20
