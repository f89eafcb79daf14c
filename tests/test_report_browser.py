"""The report page in a browser: no network, no console errors, and controls that do what they say."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from testbed.report import run_part
from testbed.report.page import page as page_of
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.studies.comparison.comparison import Comparison, compare

pytestmark = pytest.mark.slow
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
MAY_LOAD = ("file:", "data:", "blob:")


@pytest.fixture(scope="module")
def comparison(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    """Twenty vehicles for twenty seconds on two plants: as large as a page of the paper's scenarios gets."""
    fields = ["filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]
    scenarios = {p: load("paper-20-turn", [*fields, f"plant={p}"]) for p in ("unicycle", "lagged")}
    return compare(scenarios, tmp_path_factory.mktemp("pages") / "twenty vehicles")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A page of a headless Chromium with a profile of its own; what it complains of is in `page.trouble`."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (extra: dev)")
    path = next((p for p in map(shutil.which, NAMES) if p), None)
    if path is None:
        pytest.skip(f"no browser is installed (looked for {', '.join(NAMES)})")
    with playwright.sync_playwright() as p, tempfile.TemporaryDirectory() as profile:
        try:
            context = p.chromium.launch_persistent_context(
                profile, executable_path=path, headless=True, args=FLAGS, accept_downloads=True
            )
        except playwright.Error as error:
            pytest.skip(f"the browser does not start: {str(error).splitlines()[0]}")
        page = context.pages[0]
        page.trouble = []
        page.on("console", lambda m: page.trouble.append(f"console {m.type}: {m.text}"))
        page.on("pageerror", lambda e: page.trouble.append(f"error: {e}"))
        page.on("dialog", lambda d: (page.trouble.append(f"dialog: {d.message}"), d.dismiss()))
        page.on("request", lambda r: r.url.startswith(MAY_LOAD) or page.trouble.append(f"request: {r.url}"))
        yield page
        context.close()


@pytest.fixture
def page(browser: Any, comparison: Comparison) -> Iterator[Any]:
    """The comparison's page, freshly opened."""
    browser.trouble.clear()
    browser.goto((comparison.path / "report.html").as_uri())
    until(browser, lambda: int(state(browser, "drawn")) > 0)
    yield browser
    assert browser.trouble == []


def until(page: Any, holds: Callable[[], bool], seconds: float = 30) -> None:
    """Wait till it holds; the page's policy forbids the driver's own way, which evaluates strings."""
    for _ in range(round(seconds / 0.05)):
        if holds():
            return
        page.wait_for_timeout(50)
    raise AssertionError("waited in vain")


def state(page: Any, name: str) -> str:
    return str(page.eval_on_selector(".player", f"e => e.dataset.{name}"))


def now(page: Any) -> float:
    return float(state(page, "t"))


def pixels(page: Any) -> str:
    return str(page.eval_on_selector("canvas.plan", "e => e.toDataURL()"))


def test_the_page_is_small_and_opens_at_the_worst_moment(page: Any, comparison: Comparison) -> None:
    assert (comparison.path / "report.html").stat().st_size < 6e6
    lost = comparison.runs["lagged"].guarantee("separation")
    assert lost["verdict"] == "violated"
    assert now(page) == pytest.approx(lost["t_s"], abs=1e-3)
    assert "LOST on lagged; kept on unicycle" in page.text_content(".headline")


def test_the_slider_moves_time_and_the_picture(page: Any) -> None:
    slider = page.locator("[data-part=time]")
    slider.focus()
    page.keyboard.press("Home")
    assert now(page) == 0.0
    first = pixels(page)
    page.keyboard.press("End")
    assert now(page) == pytest.approx(20.0)
    assert pixels(page) != first
    box = slider.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert now(page) == pytest.approx(10.0, abs=0.5)  # a slider's thumb has a width
    assert "of 20 s" in page.text_content("[data-part=clock]")


def test_play_runs_pause_stops_and_speed_is_obeyed(page: Any) -> None:
    page.click("[data-part=start]")
    page.select_option("[data-part=rate]", "0.25")
    button = page.locator("[data-part=play]")
    button.click()
    until(page, lambda: now(page) > 0.02)
    assert button.get_attribute("aria-pressed") == "true" and "Pause" in button.text_content()
    slow = page.evaluate(RATE)
    page.select_option("[data-part=rate]", "5")
    fast = page.evaluate(RATE)
    # asked: 0.25 and 5; measured over half a second of a busy machine
    assert 0.15 < slow < 0.4 and 3 < fast < 8
    button.click()
    until(page, lambda: state(page, "playing") == "false")
    stopped = now(page)
    page.wait_for_timeout(100)
    assert now(page) == stopped and state(page, "playing") == "false"


RATE = """() => new Promise(done => {
  const root = document.querySelector('.player'), t = Number(root.dataset.t), from = performance.now();
  setTimeout(() => requestAnimationFrame(() =>
    done((Number(root.dataset.t) - t) / ((performance.now() - from) / 1000))), 500);
})"""


def test_the_keyboard_alone_drives_the_plan(page: Any) -> None:
    page.focus("canvas.plan")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert 0.0 < now(page) < 0.2
    page.keyboard.press("ArrowLeft")
    assert now(page) == 0.0
    page.keyboard.press("Space")
    until(page, lambda: state(page, "playing") == "true")
    page.keyboard.press("Space")
    until(page, lambda: state(page, "playing") == "false")
    page.keyboard.press("+")
    assert page.input_value("[data-part=view]") == "free"


def test_a_time_in_the_scorecard_opens_that_moment_and_pair(page: Any, comparison: Comparison) -> None:
    entry = comparison.runs["unicycle"].guarantee("separation")
    page.click(".scorecard tbody tr:has(td:has-text('unicycle')) .seek >> nth=0")
    assert now(page) == pytest.approx(entry["t_s"], abs=1e-3)
    assert page.input_value("[data-part=pair]") == "-".join(map(str, entry["vehicles"]))
    said = page.text_content("[data-part=readout]")
    i, j = entry["vehicles"]
    assert f"unicycle: vehicles {i} and {j} {entry['value']:.2f} m apart" in said


def test_a_plant_can_be_left_out_and_the_view_changed(page: Any) -> None:
    both = pixels(page)
    page.uncheck("[data-plant='0']")
    said = page.text_content("[data-part=readout]")
    assert "lagged" in said and "unicycle" not in said and "INSIDE Ds" in said
    one = pixels(page)
    page.select_option("[data-part=view]", "circles")
    assert len({both, one, pixels(page)}) == 3
    assert page.locator("[data-part=inputs] tr").count() == 2


def test_a_click_in_a_strip_moves_the_time(page: Any) -> None:
    strip = page.locator(".strip .u-over").first
    strip.click(position={"x": 0.25 * strip.bounding_box()["width"], "y": 5})
    assert now(page) == pytest.approx(5.0, abs=0.1)


def test_the_circles_drawn_are_as_far_apart_as_h_says(page: Any, comparison: Comparison) -> None:
    for k, done in enumerate(comparison.runs.values()):
        pairs = done.pairs[np.isclose(done.pairs.t_s, 8.0)].nsmallest(5, "h_m")
        for row in pairs.itertuples():
            drawn = page.evaluate(
                "([k, i, j]) => { const p = document.querySelector('.player').player;"
                " return p.view.pairOf(p.plants[k], 8.0, [i, j]).approach.distance; }",
                [k, int(row.i), int(row.j)],
            )
            # the scenario's delta rounds h down by up to a few mm; positions are to 1 mm
            assert drawn == pytest.approx(5.0 + row.h_m, abs=0.02)


def test_the_tracks_download_is_the_runs_tracks(page: Any, comparison: Comparison) -> None:
    with page.expect_download() as got:
        page.click("[data-part=save]")
    tracks = pd.read_csv(got.value.path())
    assert got.value.suggested_filename == "tracks.csv"
    run = comparison.runs["lagged"].vehicles.round({"t_s": 4})
    mine = tracks[tracks.plant == "lagged"].merge(run, on=["t_s", "vehicle"], suffixes=("", "_run"))
    assert len(mine) == len(run)
    assert np.abs(mine.x_m - mine.x_m_run).max() < 1e-3 and np.abs(mine.v_mps - mine.v_mps_run).max() < 0.011


def test_a_figures_data_is_a_download(page: Any, comparison: Comparison) -> None:
    with page.expect_download() as got:
        page.click("a[download='scorecard.csv']")
    table = pd.read_csv(io.StringIO(Path(got.value.path()).read_text(encoding="utf-8")))
    entry = table[(table.run == "lagged") & (table.id == "separation")].iloc[0]
    assert entry.value == pytest.approx(comparison.runs["lagged"].guarantee("separation")["value"])


def test_every_picture_has_words_and_every_control_a_name(page: Any) -> None:
    unnamed = page.evaluate(
        """() => [...document.querySelectorAll('[role=img], img, canvas.plan, canvas.close')]
        .filter(e => !(e.getAttribute('aria-label') || e.alt)).length
        + [...document.querySelectorAll('.player button, .player select, .player input')]
        .filter(e => !(e.textContent.trim() || e.ariaLabel || e.closest('label'))).length"""
    )
    assert unnamed == 0


def test_a_print_has_the_verdict_and_no_controls(page: Any) -> None:
    page.emulate_media(media="print")
    try:
        assert page.is_visible(".headline") and not page.is_visible(".controls >> nth=0")
        assert len(page.pdf()) > 100_000
    finally:
        page.emulate_media(media="screen")


def test_a_scenarios_text_runs_nothing(browser: Any, tmp_path: Path) -> None:
    browser.trouble.clear()
    evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\u2028\"'"
    flown = run(load("paper-2-turn", ["duration_s=0.1", "manoeuvre_instants=0"]))
    flown.manifest["scenario"] |= {"name": evil, "description": evil}
    file = tmp_path / "évil & spaces" / "report.html"
    file.parent.mkdir()
    file.write_text(
        page_of([run_part.part({"unicycle": flown, evil: flown}, None, "évil <b>")]), encoding="utf-8"
    )
    browser.goto(file.as_uri())
    until(browser, lambda: int(state(browser, "drawn")) > 0)
    assert evil[:60] in browser.text_content("h1") and "évil <b>" in browser.text_content(".what")
    assert browser.locator("img[src=x]").count() == 0
    browser.click("[data-part=forward]")
    assert evil[:60] in browser.text_content("[data-part=readout]")
    assert browser.trouble == []
