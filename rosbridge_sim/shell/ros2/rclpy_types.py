"""ROS 2 as it is installed for this Python: rclpy, the classes of its types, and messages as CDR and back."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.quality import Quality

RclpyObject: TypeAlias = Any
"""A class or an object of rclpy, which is not there when types are checked."""


def why_not_there() -> str | None:
    """Return why rclpy cannot be used; None if it can."""
    if importlib.util.find_spec("rclpy") is None:
        return "rclpy is not installed for this Python; source setup.bash of ROS 2 first"
    try:
        importlib.import_module("rclpy.executors")
    except Exception as error:  # noqa: BLE001 - a library with a part in C: any error means that it cannot be used here
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        return f"rclpy cannot be imported by Python {version}: {error!r:.200}"
    return None


def share_folders() -> list[Path]:
    """Return the folders with packages of ROS 2: those of the environment, then the one beside rclpy."""
    folders = [Path(one) / "share" for one in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if one]
    spec = importlib.util.find_spec("rclpy")
    if spec is not None and spec.origin is not None:
        folders += [at / "share" for at in Path(spec.origin).parents if (at / "share" / "rclpy").is_dir()][:1]
    return [folder for folder in dict.fromkeys(folders) if folder.is_dir()]


class InstalledTypes:
    """Classes of types for rclpy.

    A class is imported only if its definition is installed, because other programs name types, too.

    Attributes:
        texts: definitions of all installed types, by package, kind and name.
    """

    def __init__(self, texts: Mapping[tuple[str, str, str], str]) -> None:
        self.texts = texts
        self._classes: dict[str, RclpyObject] = {}

    def has(self, name: str) -> bool:
        """Return whether a type is installed."""
        try:
            self.find(name)
        except GraphError:
            return False
        return True

    def find(self, name: str) -> RclpyObject:
        """Return the class of a type.

        Args:
            name: `pkg/msg/Type`, `pkg/srv/Type` or `pkg/action/Type`.

        Raises:
            GraphError: it is not installed.
        """
        known = self._classes.get(name)
        if known is not None:
            return known
        package, kind, short = name.split("/")
        if (package, kind, short) not in self.texts:
            raise GraphError(f"{name} is not installed for ROS 2; build its package, and source its setup.bash")
        try:
            found = getattr(importlib.import_module(f"{package}.{kind}"), short)
            type(found).__import_type_support__()
        except Exception as error:  # noqa: BLE001 - generated code with a part in C
            raise GraphError(f"{name} cannot be used by rclpy: {error!r:.200}") from None
        self._classes[name] = found
        return found


@contextmanager
def rclpy_errors() -> Iterator[None]:
    """Turn errors of the library into those of the graph."""
    try:
        yield
    except GraphError:
        raise
    except Exception as error:  # noqa: BLE001 - of the library
        raise GraphError(f"rclpy refuses it: {error!r:.200}") from None


def write_cdr(message: RclpyObject) -> bytes:
    """Return a message of rclpy in CDR."""
    from rclpy.serialization import serialize_message  # noqa: PLC0415 - 0.5 s, and only with --ros2-domain

    return bytes(serialize_message(message))


def read_cdr(raw: bytes, found: RclpyObject) -> RclpyObject:
    """Return the message of a class of rclpy whose CDR is given."""
    from rclpy.serialization import deserialize_message  # noqa: PLC0415 - see above

    return deserialize_message(raw, found)


def rclpy_quality(quality: Quality) -> RclpyObject:
    """Return a quality as rclpy has it."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: PLC0415 - see above

    return QoSProfile(
        depth=max(1, quality.depth),
        reliability=ReliabilityPolicy.RELIABLE if quality.is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.is_latched else DurabilityPolicy.VOLATILE,
    )


def no_events(*, is_writer: bool) -> RclpyObject:
    """Return the choice to be told of no events, of which rclpy would wait for several with each endpoint."""
    from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks  # noqa: PLC0415 - see above

    return (PublisherEventCallbacks if is_writer else SubscriptionEventCallbacks)(use_default_callbacks=False)
