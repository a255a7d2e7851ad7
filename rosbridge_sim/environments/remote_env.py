"""The ego of a running server as an environment."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.environments.driving_env import DrivingEnv
from rosbridge_sim.environments.driving_vector_env import DrivingVectorEnv
from rosbridge_sim.worlds.remote_worlds import RemoteWorlds


class RemoteDrivingEnv(DrivingEnv):
    """An environment in the world of a server, which this program alone moves.

    It does what `Drive-v0` does with the scenario, the traffic and the seed of that server, to the bit. The ego keeps
    its gear, begins where the scenario has it, and is driven by `Continuous` or `Pedals`. Its goal may be a lane.

    Args:
        url: of the server, such as `ws://127.0.0.1:9090`.
        token: of the server; None for none.
        render_mode: `rgb_array` or None; the server has a page.
        options: those of `DrivingTask`; `scenario` and `traffic` are the server's.

    Raises:
        ValueError: an option is out of range, or does not fit a server.
        ClientError: there is no server, or it refuses; the text says why.
    """

    def __init__(
        self,
        url: str = "ws://127.0.0.1:9090",
        *,
        token: str | None = None,
        render_mode: str | None = None,
        **options: Any,  # noqa: ANN401 - those of DrivingTask
    ) -> None:
        self._url, self._token = url, token
        for name, expected in (("start_lane", ""), ("reverses", False)):
            if options.get(name, expected) != expected:
                raise ValueError(f"{name}: expected {expected!r} with a server, got {options[name]!r}")
        if options.get("goal") == "bay":
            raise ValueError("goal: expected '' or 'lane' with a server, whose traffic stays, got 'bay'")
        if options.get("action", "Continuous") == "DiscreteMeta":
            raise ValueError("action: expected Continuous or Pedals with a server, got 'DiscreteMeta'")
        if render_mode == "human":
            raise ValueError("render_mode: expected rgb_array or None, because the server has a page of its own")
        super().__init__(render_mode=render_mode, **options)

    def _make_many(self, **options: Any) -> DrivingVectorEnv:  # noqa: ANN401 - as above
        return _RemoteVectorEnv(self._url, self._token, **options)


class _RemoteVectorEnv(DrivingVectorEnv):
    """The one environment of a server."""

    _remote: RemoteWorlds | None = None  # as `_view`

    def __init__(self, url: str, token: str | None, **options: Any) -> None:  # noqa: ANN401 - as above
        self._url, self._token = url, token
        super().__init__(1, **options)

    def _make_worlds(self, num: int) -> RemoteWorlds:
        del num
        self._remote = RemoteWorlds(self._url, token=self._token)
        return self._remote

    def close_extras(self, **_: Any) -> None:  # noqa: ANN401 - Gymnasium's own form
        """End the connection."""
        if self._remote is not None:
            self._remote.close()
