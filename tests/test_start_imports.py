"""Modules that a start does without: each would cost time at every start, and memory in every server."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support import ROOT

SERVE = """
import asyncio
import rosbridge_sim.__main__
import rosbridge_sim.serving
from rosbridge_sim.shell.app import Simulator
async def main():
    for release in ("22.R2", "26.R1"):
        async with Simulator(port=0, release=release):
            pass
asyncio.run(main())
"""

RARE = {
    *("pydantic", "pydantic_core", "numpy.ma", "PIL", "pyproj", "rosbags", "markdown_it", "prometheus_client"),
    *("difflib", "tomllib", "gzip", "html", "cyclonedds", "moderngl", "pyarrow", "cma", "ruamel", "lz4", "rich"),
    *("embreex", "simplejpeg"),
    *(
        "rosbridge_sim.graph.gateway.gateway",
        "rosbridge_sim.graph.ros1",
        "rosbridge_sim.graph.ros2.cdr_types",
        "xmlrpc",
    ),
    *("rosbridge_sim.shell.ros1", "rosbridge_sim.shell.ros2", "rosbridge_sim.maps.opendrive"),
    *(
        "rosbridge_sim.scenarios.events",
        "rosbridge_sim.scenarios.openscenario.story",
        "rosbridge_sim.documents.xml_documents",
    ),
    *("rosbridge_sim.simulator.story.running_story", "rosbridge_sim.scenarios.openscenario.places"),
    *(
        "rosbridge_sim.documents.document_mistakes",
        "rosbridge_sim.shell.attach",
        "rosbridge_sim.shell.page.module_joining",
    ),
    *("rosbridge_sim.campaigns", "rosbridge_sim.cli", "rosbridge_sim.environments", "rosbridge_sim.shell.rendering"),
}


def modules_after(code: str) -> set[str]:
    """The modules that a program has imported at its end."""
    code += "\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.split())


@pytest.mark.slow
def test_default_server_imports_no_module_that_few_servers_need() -> None:
    loaded = modules_after(SERVE)
    assert "rosbridge_sim.simulator.simulator_node" in loaded
    assert loaded & RARE == set()


def test_list_of_results_of_a_campaign_imports_nothing_that_drives() -> None:
    loaded = modules_after("import rosbridge_sim.cli.campaigns.campaign_results")
    assert loaded & {"numpy", "pydantic", "rosbridge_sim.world", "rosbridge_sim.campaign_runs.worker"} == set()


HELP = """
import contextlib, os, sys
import rosbridge_sim.__main__
for words in (["--help"], ["topic", "echo", "--help"], ["--version"]):
    sys.argv[1:] = words
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(open(os.devnull, "w")):
        rosbridge_sim.__main__.main()
"""


def test_help_imports_neither_the_world_nor_numpy() -> None:
    loaded = modules_after(HELP)
    assert loaded & {"numpy", "pydantic", "msgspec", "rosbridge_sim.world", "rosbridge_sim.schema"} == set()
