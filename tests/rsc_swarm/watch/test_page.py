"""The page in a real browser: a flight is watched, a drone is killed by a click, and the flight is looked at again.

With ``RSC_SWARM_SCREENSHOTS=docs`` the pictures of docs/view.md are taken.
"""

import json
import os
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the page needs the extra 'view'")
from websockets.sync.client import connect

from tests.rsc_swarm.watch.browsers import Page, browser, command, needs_browser

pytestmark = needs_browser
SCREENSHOTS = os.environ.get("RSC_SWARM_SCREENSHOTS")


def keep(page: Page, name: str) -> None:
    if SCREENSHOTS:
        page.page.screenshot(path=Path(SCREENSHOTS) / name)


def pause_at_once(address: str) -> None:
    """Browsers take their time on a busy machine: the flight waits for them, and goes slowly then."""
    place, token = address.removeprefix("http://").split("/#")
    with connect(f"ws://{place}/live", max_size=None) as page:
        page.send(token)
        page.send(json.dumps({"pace": {"speed": 0.25, "paused": True}}))
        while '"paused":true' not in str(page.recv(60)):
            pass


def field(page: Page) -> str:
    """What is drawn of the field, a few frames from now."""
    frames = page.value("page.frames()")
    page.until(f"page.frames() > {frames + 3}")
    return str(page.value("document.getElementById('field').toDataURL()"))


def test_plans_of_a_launch_are_drawn() -> None:
    """Each drone's process has told its own; they are short, so one looks closely."""
    words = ["--agents", "4", "--policy", "rsc-h20", "--set", "fly_s=20", "--view"]
    told = "points.slice(8 * drone, 8 * drone + 8).filter(Number.isFinite).length"
    all_plan = f"({{ time, plans: {{ points }} }}) => time > 2 && [0, 1, 2, 3].every((drone) => {told} > (drone ? 0 : 4))"
    with browser() as chromium, command("launch", *words) as (_, address):
        pause_at_once(address)
        page = Page(chromium, address)
        page.until("page.recording.pictures.length > 0")
        page.page.click("text=Let the flight go on")
        page.until(f"page.recording.pictures.some({all_plan})")
        page.page.click("#play")
        page.value(f"page.play.time = page.recording.pictures.find({all_plan}).time")
        page.value(
            "(() => { const [x, y] = page.recording.at(page.play.time).drones;"
            " Object.assign(page.camera, { x, y, scale: 150, mode: 'free' }); })()"
        )
        page.until("page.recording.end > page.play.time + 0.3")
        with_plans = field(page)
        page.page.keyboard.press("6")
        without = field(page)
        page.page.keyboard.press("6")
        assert field(page) == with_plans != without
        assert page.complaints == []


def test_a_flight_in_the_browser(tmp_path: Path) -> None:
    run = tmp_path / "run"
    mission = ["--mission", "lost-agent", "--map", "13", "--set", "radio.loss=0.1", "--set", "fly_s=8"]
    with browser() as chromium:
        with command("simulate", *mission, "--run-dir", str(run), "--view") as (flight, address):
            pause_at_once(address)
            page = Page(chromium, address)
            page.until("page.recording.pictures.length > 0 && page.frames() > 3")
            assert page.value("page.recording.newest.count") == 25
            assert "25 drones" in page.page.inner_text("#what")
            only_looks = Page(chromium, address.split("#")[0], "dark")
            only_looks.until("page.recording.pictures.length > 0")
            assert not only_looks.page.is_visible("#hands")

            page.page.click("text=Let the flight go on")
            page.until("page.recording.end > 0.5")
            page.page.click("text=Pause the flight")
            page.until("document.getElementById('state').textContent === 'flight paused'")
            page.until("page.play.time > page.recording.end - 0.4")
            page.click_drone(12)
            page.until("page.chosen.has(12)")
            page.page.click("#hand-kill")
            page.until("page.marks().some((mark) => mark.kind === 'hand')")
            page.page.select_option("#hands select >> nth=0", "")
            page.until("page.marks().some((mark) => mark.kind === 'kill' && mark.drones[0] === 12)")
            page.until("page.recording.report")
            for each in (page, only_looks):
                assert each.value("page.recording.report.lost_agents") == [8, 12]
                assert each.complaints == []
            flight.communicate(timeout=60)
        report = json.loads((run / "report.json").read_text())
        assert report["lost_agents"] == [8, 12]
        assert [fault["kind"] for fault in report["mission"]["faults"]] == ["kill", "kill"]

        with command("replay", str(run)) as (_, address):
            assert "#" not in address
            page = Page(chromium, address)
            page.until("page.recording.report && page.recording.pictures.length === 201")
            page.page.keyboard.press("Space")
            box = page.page.locator("#timeline").bounding_box()
            assert box
            page.page.mouse.click(box["x"] + 66 + (box["width"] - 80) * 0.75, box["y"] + 95)
            assert page.value("page.play.time") == pytest.approx(6.0, abs=0.1)
            page.page.keyboard.press("ArrowLeft")
            assert page.value("page.play.time") == pytest.approx(5.9, abs=0.11)
            page.until("document.getElementById('time').textContent.startsWith('5.')")
            keep(page, "view.png")
            page.page.keyboard.press("d")
            page.click_drone(7)
            page.until("document.getElementById('panel').textContent.includes('its view is right')")
            keep(page, "view-drone.png")
            button = "document.querySelector('#panel h2 button').getBoundingClientRect()"
            left, top = page.value(f"(() => {{ const box = {button}; return [box.x + 8, box.y + 8]; }})()")
            page.page.mouse.click(left, top, delay=400)  # longer than a panel stays the same
            page.until("page.chosen.size === 0")
            page.page.set_viewport_size({"width": 1180, "height": 700})  # a smaller window is a smaller page
            page.until("document.getElementById('field').clientWidth === 1180")
            assert page.page.is_visible("#help")
            page.page.keyboard.press("Home")
            assert page.value("page.play.time") == 0
            page.page.keyboard.press("?")
            assert "Marks on the time line" in page.page.inner_text("#about")
            assert page.complaints == []
