"""The user's own expressions, judged frame by frame while a drive goes on.

Nothing of the drive is kept for it: an expression has its last value, and those of its functions over time. An
expression over topics has no value before the first message. `always` then waits; a limit that has no value until the
end of the drive cannot be judged, and the run is an error.
"""

from __future__ import annotations

from collections.abc import Mapping

from rosbridge_sim.campaigns.drive_limits import Limits
from rosbridge_sim.campaigns.run_results import Breach
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Expression, Following, Value
from rosbridge_sim.printable import printable


class OwnLimits:
    """The own limits of a campaign over one drive.

    Attributes:
        trouble: why a limit cannot be judged; empty if all can.
    """

    def __init__(self, limits: Limits) -> None:
        self.trouble = ""
        self._always = {name: (Following(each), after) for name, (each, after) in limits.always.items()}
        self._end = {name: Following(each) for name, each in limits.end.items()}
        self._waiting = set(self._always)
        self._found: list[Breach] = []
        self._last: Mapping[str, Value] = {}

    @property
    def is_judging(self) -> bool:
        """True if there is something to judge."""
        return bool(self._always or self._end) and not self.trouble

    def take(self, values: Mapping[str, Value]) -> None:
        """Judge one frame.

        Args:
            values: figures of the frame, parameters, and fields of topics that have a value.
        """
        self._last = values
        try:
            for name, (following, after) in list(self._always.items()):
                if float(values["time"]) < after:
                    continue
                following.take(values)
                value = following.value(values)
                if value is None:
                    continue
                self._waiting.discard(name)
                if not value:
                    self._found.append(_breach(name, following, values, ""))
                    del self._always[name]
            for following in self._end.values():
                following.take(values)
        except DocumentError as error:
            self.trouble = str(error)

    def end(self) -> list[Breach]:
        """Return the breaches of the whole drive, after its last frame; `trouble` may have a text then."""
        found = list(self._found)
        if self.trouble or not self._last:
            return found
        try:
            for name, following in self._end.items():
                value = following.value(self._last)
                if value is None:
                    self._waiting.add(name)
                elif not value:
                    found.append(_breach(name, following, self._last, " at the end"))
        except DocumentError as error:
            self.trouble = str(error)
        for name in sorted(self._waiting):
            following = self._end[name] if name in self._end else self._always[name][0]
            self.trouble = self.trouble or _why_not(following.expression, self._last)
        return found


def _why_not(expression: Expression, values: Mapping[str, Value]) -> str:
    """Return why an expression has no value."""
    missing = sorted(each.text for each in expression.fields if each.text not in values)
    if missing:
        return f"{expression.where}: {missing[0]} has no value: no message came that has it"
    return f"{expression.where}: it was never judged: the drive ended before"


def _breach(name: str, following: Following, values: Mapping[str, Value], when: str) -> Breach:
    """Return a breach in a frame, with the values that the expression has read."""
    known = {**values, **following.running}
    names = sorted({*following.expression.names, *following.running})
    told = [f"{each} {known[each]:.5g}" for each in names if isinstance(known.get(each), int | float)]
    text = f"expected {printable(following.expression.text, 120)}{when}{'; ' if told else ''}{', '.join(told)}"
    place = [round(float(values[key]), 2) for key in ("time", "x", "y")]
    return Breach(name, text, *place)
