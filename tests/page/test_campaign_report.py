"""The page of a campaign in Chromium: it loads nothing, sorts, filters, and has no serious fault of accessibility."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.writing import PAGE
from rosbridge_sim.campaigns.report import Details, PageParts, write_report
from rosbridge_sim.campaigns.run_results import Breach, Result, Run, Verdict
from tests.page.conftest import OpenPage
from tests.page.test_page import faults_of

pytestmark = [pytest.mark.client, pytest.mark.slow]

SCRIPT = "</script><script>document.title = 'taken over'</script>"


def results_of(num: int) -> list[Result]:
    found = []
    for i in range(num):
        verdict: Verdict = "fail" if i % 5 == 2 else "pass"
        run = Run(
            i + 1, "town", "ours" if i % 2 else "mine", 0, {"gap": i % 10, "kmh": 10.0 * (i // 10), "sky": SCRIPT}
        )
        breaches = (Breach("collisions", SCRIPT, 1.0, 2.0, 3.0),) if verdict == "fail" else ()
        scores = {"distance": float(i), "min_time_to_collision": math.inf}
        path = ((0.0, 0.0), (1.0, i + 0.5))
        found.append(Result(run, verdict, SCRIPT if breaches else "", breaches, scores, 10, "abc", path))
    return found


def page_of(results: list[Result], folder: Path) -> str:
    parts = PageParts(*((PAGE / f"report.{kind}").read_text("utf-8") for kind in ("html", "css", "js")))
    times = [0.02 * (i + 1) for i in range(50)]
    trace = {
        "time": times,
        "x": times,
        "y": times,
        "speed": times,
        "distance": times,
        "time_to_collision": [math.inf] * 50,
    }
    scene = {"roads": [[[0, 0], [5, 5]]], "neighbours": [[1.0, [[0, 1, 1, 0, 2.0, 1.0, 0.5, 0]]]]}
    bad = [each for each in results if each.verdict == "fail"][:50]
    details = [
        Details(each, trace, scene, SCRIPT, {"trace.csv": "runs/x/trace.csv"}, f"repeat {SCRIPT}") for each in bad
    ]
    (folder / "report.html").write_text(write_report(parts, f"night {SCRIPT}", results, ["gap", "kmh", "sky"], details))
    return (folder / "report.html").as_uri()


@pytest.mark.parametrize(("scheme", "width", "num"), [("light", 390, 150), ("dark", 820, 20), ("light", 1440, 150)])
async def test_report_is_readable_at_each_width_and_runs_nothing_of_the_results(
    open_page: OpenPage, tmp_path: Path, scheme: str, width: int, num: int
) -> None:
    page = await open_page(
        page_of(results_of(num), tmp_path),
        state=None,
        color_scheme=scheme,
        viewport={"width": width, "height": 800},
        bypass_csp=True,  # for axe
    )
    assert await faults_of(page) == []
    assert await page.evaluate("document.documentElement.scrollWidth") <= width
    assert (await page.title()).startswith("night")
    assert await page.evaluate("performance.getEntriesByType('resource').length") == 0


async def test_table_sorts_and_filters_by_keyboard(open_page: OpenPage, tmp_path: Path) -> None:
    page = await open_page(page_of(results_of(150), tmp_path), state=None)
    rows = page.locator("#table tbody tr")
    assert await rows.count() == 100
    heads = await page.locator("#table th").all_inner_texts()
    assert heads == ["run ▲", "verdict", "driver", "gap", "kmh", "reason", "path"], (
        "what is the same in all is left out"
    )
    await page.locator("#scores").check()
    assert {"scenario", "seed", "sky", "distance"} <= {*await page.locator("#table th").all_inner_texts()}
    await page.locator("#scores").uncheck()
    await page.locator("#later").press("Enter")
    assert await rows.count() == 50
    await page.locator("#text").fill("gap=7 kmh=120")
    assert await page.locator("#table caption").inner_text() == "1 of 150 runs"
    await page.locator("#text").fill("")
    await page.locator("#verdict").select_option("not passed")
    assert await page.locator("#table caption").inner_text() == "30 of 150 runs"
    await page.locator("th button", has_text="run").press("Enter")
    assert await rows.first.locator("td").first.inner_text() == "148"
    assert await page.locator("#form").input_value() == "map"
    assert "75 cells of 75 runs, 60 pass" in await page.locator("#picture-text").inner_text()
    await page.locator("#pictured").select_option("all")
    assert "150 cells of 150 runs, 120 pass" in await page.locator("#picture-text").inner_text()
    await page.locator("#form").select_option("points")
    assert (await page.locator("#picture-text").inner_text()).startswith("150 runs.")


async def test_samples_are_points_of_one_driver_over_the_two_strongest_parameters(
    open_page: OpenPage, tmp_path: Path
) -> None:
    results = []
    for i in range(90):
        k = i // 3
        gap, hue, kmh = (k * 7 % 30) / 30, (k * 11 % 30) / 30, (k * 13 % 30) / 30
        verdict: Verdict = "fail" if gap + kmh > 1.0 else "pass"
        run = Run(i + 1, "town", f"driver{i % 3}", 0, {"hue": hue, "gap": gap, "kmh": kmh})
        results.append(Result(run, verdict, scores={"distance": float(i)}))
    parts = PageParts(*((PAGE / f"report.{kind}").read_text("utf-8") for kind in ("html", "css", "js")))
    (tmp_path / "report.html").write_text(write_report(parts, "night", results, ["hue", "gap", "kmh"], []))
    page = await open_page((tmp_path / "report.html").as_uri(), state=None)
    text = page.locator("#picture-text")
    assert (await text.inner_text()).startswith("30 runs. gap across, kmh up; driver driver0; colour: verdict")
    assert await page.locator("#form").input_value() == "points"
    await page.locator("#pictured").select_option("driver2")
    assert "30 runs. gap across, kmh up; driver driver2" in await text.inner_text()
    await page.locator("#pictured").select_option("all")
    assert (await text.inner_text()).startswith("90 runs. gap across, kmh up; colour")


async def test_ten_thousand_runs_are_shown_a_page_at_a_time(open_page: OpenPage, tmp_path: Path) -> None:
    page = await open_page(page_of(results_of(10_000), tmp_path), state=None)
    assert await page.locator("#table caption").inner_text() == "10,000 of 10,000 runs"
    assert await page.locator("#table tbody tr").count() == 100
    assert await page.locator("#failures-title ~ details").count() == 50
