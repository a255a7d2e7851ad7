"""Programs that cannot tick: the world runs in real time, from the moment at which they connect."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaign_runs.checking import check_job
from rosbridge_sim.errors import DocumentError
from tests.campaign_runs.conftest import CampaignFolder

PROGRAM = """
import os
from rosbridge_sim.client import Client

with Client(os.environ["ROSBRIDGE_SIM_URL"]) as client, client.subscribe("/Ego_topic") as topic:
    for ego in topic:
        client.publish("/ctrl_cmd", {"longlCmdType": 1, "accel": 1.0}, "morai_msgs/CtrlCmd")
"""


@pytest.mark.slow
def test_program_that_cannot_tick_drives_in_real_time(folder: CampaignFolder) -> None:
    folder.write("program.py", PROGRAM)
    folder.write("idle.py", "import time\ntime.sleep(60)\n")
    campaign = """
        scenario = "loop"
        seconds = {}
        end_when = "/Ego_topic.velocity.x > 1"
        [set]
        "setting.real_time_factor" = 4
        [drivers]
        program = {{ command = ["{{python}}", "{}"], real_time = true, timeout = {} }}
        """
    (moving,) = folder.drive(campaign.format(60, "program.py", 90))
    assert (moving.verdict, moving.reason) == ("pass", "")
    assert 1 < moving.frames < 3000  # of 60 s, so that a busy machine may be late
    assert moving.scores["max_speed"] > 1.0
    (idle,) = folder.drive(campaign.format(1, "idle.py", 0.5))
    assert idle.reason == "time-out: 0.5 s on the wall clock have passed after 0 frames"


def test_time_out_below_the_time_of_the_drive_is_told_before(folder: CampaignFolder) -> None:
    text = 'scenario = "loop"\nseconds = 20\n[drivers]\np = {{ {}, real_time = true, timeout = 20 }}\n'
    with pytest.raises(DocumentError, match=r"drivers\.p\.timeout: expected more than the 20 s"):
        check_job(folder.job(text.format('command = ["true"]')))
    with pytest.raises(DocumentError, match=r"drivers\.p.*real_time is for drivers with a command"):
        check_job(folder.job(text.format('own = "lanes"')))
