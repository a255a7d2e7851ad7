"""Plans of programs in a recording: paths, markers and other messages that viewers draw.

Messages stay as the bytes of the bag until somebody listens, because most of a recording is never looked at.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from typing import Final

from rosbridge_sim.records import Record

PLAN_TYPES: Final = frozenset({
    *("nav_msgs/Path", "nav_msgs/Odometry", "geometry_msgs/PoseStamped"),
    *("visualization_msgs/Marker", "visualization_msgs/MarkerArray"),
    *("sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"),
})  # fmt: skip
"""Types that the page draws, and RViz and Foxglove, too."""

MAX_PLAN_BYTES: Final = 64_000_000
"""Bytes of all plans of a recording; later ones are left out. A path of 5 kB, ten times a second, is 3 MB a minute."""


MAX_PLAN_TOPICS: Final = 100
"""Topics with plans of a recording; later ones are left out. Each is put on the bus when the replay begins."""

MAX_PLAN_MESSAGE: Final = 1_500_000
"""Bytes of a message, beside those of a cloud's points; a longer one is left out. 3,700 markers of ten points each are
as many. To write them as CBOR takes 45 ms, which all clients wait for."""

MAX_CLOUD_BYTES: Final = 8_000_000
"""Bytes of a PointCloud2 with its points: half a million of them, more than the sensors of an ego give in a frame."""


class RecordedPlan(Record, eq=False):
    """Messages of one topic.

    Attributes:
        times: since the first stamp of the recording, rising [ns].
        raws: the bytes of each message.
        decode: makes plain objects of them, as `MessageType.check` takes them; may be called in any thread, compiles
            nothing, and raises DocumentError where they are broken or too long.
    """

    topic: str
    type_name: str
    times: list[int]
    raws: list[bytes]
    decode: Callable[[bytes], object]

    def between(self, after_ns: int, until_ns: int) -> list[bytes]:
        """Return the messages of a time, the oldest first.

        Args:
            after_ns: the time behind which it begins, since the recording's first stamp [ns].
            until_ns: its end, which belongs to it [ns].
        """
        return self.raws[bisect_right(self.times, after_ns) : bisect_right(self.times, until_ns)]

    def last(self, until_ns: int) -> list[bytes]:
        """Return the last message up to a time, in a list; none if there is none yet.

        Args:
            until_ns: the time, since the recording's first stamp [ns].
        """
        at = bisect_right(self.times, until_ns)
        return self.raws[max(at - 1, 0) : at]
