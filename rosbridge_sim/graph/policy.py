"""What clients may do on the bus: patterns that allow and deny, by direction.

The patterns are rosbridge_suite's globs: shell patterns (`*`, `?`, `[abc]`) over absolute names, in which `*` runs
across slashes. Without an allow pattern everything is allowed; a deny pattern beats every allow pattern.
rosbridge_suite lets an empty list deny all, which nobody reads out of an empty list: here that is `--deny-... '*'`.

An action is judged by the patterns of services: it is a long call. rosapi's own services can always be called
unless a deny pattern names them, since no client gets far without looking around; what they list is what the
asking client could use. The simulator's own node and rosapi are not subject to any of this.

Names are judged when they are first used (advertise, subscribe, the first bare publish, each call), never per message.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fnmatch import translate
from functools import lru_cache

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.owner import resolve

__all__ = ["OPEN", "Policy", "Rule"]

ROSAPI = "/rosapi/"
"""Where the names of the services begin with which clients look around."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Which names may be used in one way.

    Attributes:
        allow: patterns, one of which a name must match; empty where any name will do.
        deny: patterns, none of which it may match.
    """

    allow: tuple[str, ...] = ()
    deny: tuple[str, ...] = ()

    def admits(self, name: str) -> bool:
        """Whether a name may be used.

        Raises:
            GraphError: there are patterns, and it is no name.
        """
        return not self.denies(name) and (not self.allow or _matches(self.allow, resolve(name)))

    def denies(self, name: str) -> bool:
        """Whether a deny pattern matches the name; raises as `admits` does."""
        return bool(self.deny) and _matches(self.deny, resolve(name))


@dataclass(frozen=True, slots=True)
class Policy:
    """What every client may do. Each `check_...` does nothing where the name, relative or absolute, may be used so.

    Attributes:
        publish, subscribe: for topics.
        service: for services and actions, to call and to offer.
        parameter: for parameters, to read and to write.
        max_held: advertisements, subscriptions, services and actions that one client may hold.
    """

    publish: Rule = Rule()
    subscribe: Rule = Rule()
    service: Rule = Rule()
    parameter: Rule = Rule()
    max_held: int = 10_000

    def check_publish(self, topic: str) -> None:
        """Raise GraphError if the topic may not be published to."""
        if not self.publish.admits(topic):
            raise GraphError(f"Not allowed to publish to {topic}", reason=Reason.NOT_ALLOWED)

    def check_subscribe(self, topic: str) -> None:
        """Raise GraphError if the topic may not be listened to."""
        if not self.subscribe.admits(topic):
            raise GraphError(f"Not allowed to subscribe to {topic}", reason=Reason.NOT_ALLOWED)

    def check_call(self, name: str) -> None:
        """Raise GraphError if the service may not be called, or no goal be sent to the action."""
        if not self.may_call(name):
            raise GraphError(f"Not allowed to call {name}", reason=Reason.NOT_ALLOWED)

    def check_offer(self, name: str) -> None:
        """Raise GraphError if no service and no action may be offered under that name."""
        if not self.service.admits(name):
            raise GraphError(f"Not allowed to offer {name}", reason=Reason.NOT_ALLOWED)

    def check_parameter(self, name: str) -> None:
        """Raise GraphError if the parameter may be neither read nor written."""
        if not self.parameter.admits(name):
            raise GraphError(f"Not allowed to use the parameter {name}", reason=Reason.NOT_ALLOWED)

    def may_call(self, name: str) -> bool:
        """Whether a service may be called, or a goal be sent to an action."""
        rule = self.service
        return rule.admits(name) or (resolve(name).startswith(ROSAPI) and not rule.denies(name))

    def may_see(self, topic: str) -> bool:
        """Whether a topic is any of a client's business: it may publish there, or listen."""
        return self.publish.admits(topic) or self.subscribe.admits(topic)


OPEN = Policy()
"""Everything is allowed."""


@lru_cache(maxsize=4096)
def _matches(patterns: tuple[str, ...], name: str) -> bool:
    return _compile(patterns).match(name) is not None


@lru_cache(maxsize=64)
def _compile(patterns: tuple[str, ...]) -> re.Pattern[str]:
    """One expression for all; a pattern that begins as a name does is meant from the root."""
    return re.compile("|".join(translate(p if p[:1] in {"/", "*", "?", "["} else f"/{p}") for p in patterns))
