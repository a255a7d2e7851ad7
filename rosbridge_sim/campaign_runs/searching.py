"""Running a search: the library asks for a batch of runs, they are driven, and it is told what came out."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

from rosbridge_sim.campaign_runs.running import CampaignRunner
from rosbridge_sim.campaigns.run_results import BAD, Result
from rosbridge_sim.campaigns.search import MakeStrategy, Search
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import replace


def drive_search(runner: CampaignRunner, there: Mapping[int, Result]) -> None:
    """Search in each group of a campaign.

    The search asks for the same runs again after an interruption, because it depends on its seed and on the results
    alone. So runs whose results are there are not driven twice.

    Args:
        there: results by number; the runner's `tell` adds to them.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        DocumentError: the extra `campaign` is missing.
    """
    campaign = runner.campaign
    document = campaign.document.search
    assert document is not None
    make = load_strategy()
    for i, group in enumerate(campaign.groups()):
        search = Search(campaign.document, campaign.source, make)
        first = 1 + i * document.budget
        while points := search.ask():
            numbered = enumerate(points, first + search.num_asked - len(points))
            runs = [replace(group, number=number, parameters=point) for number, point in numbered]
            runner.drive([run for run in runs if run.number not in there])
            results = [there[run.number] for run in runs]
            search.tell(results)
            if document.stop_at_failure and any(result.verdict in BAD for result in results):
                break


def load_strategy() -> MakeStrategy:
    """Return the library's class.

    Raises:
        DocumentError: the extra `campaign` is missing.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns that it cannot draw without matplotlib
            from cma import CMAEvolutionStrategy  # noqa: PLC0415 - an extra
    except ImportError:
        raise DocumentError(
            "search: it needs the extra rosbridge-sim[campaign]: pip install 'rosbridge-sim[campaign]'"
        ) from None
    make: MakeStrategy = CMAEvolutionStrategy
    return make
