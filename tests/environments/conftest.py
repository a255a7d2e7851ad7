"""Environments of the tests need Gymnasium."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def gymnasium_is_there() -> None:
    pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")
