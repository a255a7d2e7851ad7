"""Sensors in MORAI's files, and functions that their readers share; see `morai_sensor_file`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, Final

from rosbridge_sim.documents.document_model import Document, KeptAsWritten, Number, Text, Whole
from rosbridge_sim.simulator.bus.publisher_kinds import FRAME_RATE

_UDP: Final = 1
"""`commType` of native packets over UDP."""

_TOPIC: Final = re.compile(r"/?[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*")


class _Vector(Document, frozen=True, kw_only=True):
    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0


class _Angles(Document, frozen=True, kw_only=True):
    roll: Number = 0.0
    pitch: Number = 0.0
    yaw: Number = 0.0


class _Ros(Document, frozen=True, kw_only=True):
    Topic: Text = ""
    frameID: Text = ""  # noqa: N815 - MORAI's name


class Block(Document, frozen=True, kw_only=True):
    """Values that only some kinds have; keys of other kinds are absent."""

    sensorPeriod: Number | None = None  # noqa: N815 - MORAI's names, here and below
    commType: Whole = 3  # noqa: N815
    rosConfig: _Ros = _Ros()  # noqa: N815
    cameraFOV: Number = 90.0  # noqa: N815
    cameraType: Whole = 0  # noqa: N815
    compressedRatio: Number = 90.0  # noqa: N815
    focalLengthpixel: Number | None = None  # noqa: N815
    principalPoint: KeptAsWritten = None  # noqa: N815
    lidar3DType: Whole = 0  # noqa: N815
    fireDistance: Number = 100.0  # noqa: N815


class Item(Document, frozen=True, kw_only=True):
    """A sensor."""

    m_TargetUniqueID: Whole = 0  # noqa: N815
    m_SensorUniqueID: Whole = 0  # noqa: N815
    pos: _Vector = _Vector()
    rot: _Angles = _Angles()
    cc: Block | None = None
    lc: Block | None = None
    rc: Block | None = None
    gc: Block | None = None
    ic: Block | None = None

    @property
    def block(self) -> Block:
        """The block of its kind."""
        return self.cc or self.lc or self.rc or self.gc or self.ic or Block()


class Reading:
    """Reading of one file.

    Attributes:
        remarks: what is not as the file has it.
    """

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self._frames: Counter[str] = Counter()
        self._target: int | None = None

    def of_ego(self, noun: str, items: Iterable[Item]) -> Iterator[Item]:
        """Yield the sensors of the ego that the first sensor of the file belongs to; every ego gets them."""
        for item in items:
            if self._target is None:
                self._target = item.m_TargetUniqueID
            if item.m_TargetUniqueID == self._target:
                yield item
            else:
                self.remarks.append(
                    f"{noun} {item.m_SensorUniqueID} left out: it belongs to vehicle {item.m_TargetUniqueID},"
                    f" and the others to {self._target}; every ego has the same sensors"
                )

    def common(self, item: Item, topic: str, frame: str) -> dict[str, Any]:
        """Return what the tables of all kinds have."""
        block = item.block
        frame = re.sub(r"[^A-Za-z0-9_.-]", "_", block.rosConfig.frameID.strip("/ ")) or frame
        self._frames[frame] += 1
        if self._frames[frame] > 1:
            self.remarks.append(f"frame {frame} stands there twice: the second one is {frame}-{self._frames[frame]}")
            frame = f"{frame}-{self._frames[frame]}"
        named = block.rosConfig.Topic.strip()
        if block.commType == _UDP:
            self.remarks.append(f"{frame}: its packets over UDP are not served; it publishes {topic}")
        elif _TOPIC.fullmatch(named):
            topic = "/" + named.lstrip("/")
        elif named:
            self.remarks.append(f"{frame}: {named[:80]!r} is not the name of a topic; it publishes {topic}")
        table: dict[str, Any] = {"frame_id": frame, "topic": topic, **place_of(item)}
        if block.sensorPeriod is not None and block.sensorPeriod > 0.0:
            rate = 1.0 / block.sensorPeriod
            table["rate"] = min(FRAME_RATE, float(round(rate)) if abs(rate - round(rate)) < 0.05 else rate)  # noqa: PLR2004 - 0.0333 s is 30 Hz
            if rate > FRAME_RATE + 0.05:
                self.remarks.append(f"{frame}: {rate:g} Hz is more than a world of 50 frames a second has; it is 50 Hz")
        return table


def place_of(item: Item) -> dict[str, float]:
    """Return place and angles as our files have them."""
    return {
        **{axis: getattr(item.pos, axis) for axis in "xyz"},
        **{angle: _signed(getattr(item.rot, angle)) for angle in ("roll", "pitch", "yaw")},
    }


def _signed(degrees: float) -> float:
    """Return an angle within [-180, 180)."""
    return (degrees + 180.0) % 360.0 - 180.0
