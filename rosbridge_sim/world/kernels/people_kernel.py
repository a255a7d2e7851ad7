"""Places of people on their paths, and kerbs, by loops in C, to the last bit as by arrays. Pushes stay with numpy."""

from __future__ import annotations

from rosbridge_sim.world.geometry.planar import ComplexArray, FloatArray
from rosbridge_sim.world.kernels.c_source import FOR_PEOPLE
from rosbridge_sim.world.kernels.loop_fields import CompiledLoops, LoopFields
from rosbridge_sim.world.people.people import People


class PeopleKernel:
    """See the head of this file. It lives as long as the people.

    Args:
        library: the loops.
        people: written.
    """

    def __init__(self, library: CompiledLoops, people: People) -> None:
        self._do, self._people = library, people
        self._fields = fields = LoopFields()
        fields.take_columns(people.world)
        fields.copy(people, "path_length stop_from start end rows first is_loop")
        fields.take(side_of=people.side, path_base=people.base)
        fields.make(FOR_PEOPLE, people.num)
        fields["n"] = people.num

    def find_places(self) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """See `People.find_places`."""
        paths = self._people.world.path_store
        self._fields.take(segments=paths.segments, keys=paths.keys)
        self._fields["num_keys"] = paths.num
        self._do["find_places"](self._fields.address)
        arrays = self._fields.arrays
        return arrays["arc"], arrays["goal"], arrays["course"]

    def mind_kerbs(self, _arc: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See `People.mind_kerbs`."""
        at, arrays, people = self._fields.address, self._fields.arrays, self._people
        num = self._do["look_at_kerbs"](at)
        if num:
            asks = arrays["asks"][:num]
            speed = people.world.desired_speed[people.rows[asks]]
            arrays["goes"][:num] = people.may_cross(asks, arrays["crossing"][:num], speed)
        self._do["mind_kerbs"](at, num)
        return arrays["wish"], arrays["slower"]
