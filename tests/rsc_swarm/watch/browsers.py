"""A real browser, and a command whose page it looks at."""

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

sync_api = pytest.importorskip(
    "playwright.sync_api", reason="playwright drives the browser: pip install -e '.[test]'"
)

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium here: apt-get install chromium")
PATIENCE_S = 60.0


@contextmanager
def browser() -> Iterator[Any]:
    """A Chromium without a window."""
    with sync_api.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield chromium
        chromium.close()


class Page:
    """A page, and what was complained about in its console."""

    def __init__(self, chromium: Any, address: str, scheme: str = "light") -> None:
        self.page = chromium.new_page(viewport={"width": 1440, "height": 860}, color_scheme=scheme)
        self.complaints: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(address)

    def value(self, script: str) -> Any:
        return self.page.evaluate(script)

    def until(self, script: str) -> Any:
        """Wait until this is true in the page; its value."""
        deadline = time.monotonic() + PATIENCE_S
        while not (value := self.value(script)):
            assert time.monotonic() < deadline, f"not within {PATIENCE_S:g} s: {script}"
            time.sleep(0.03)
        return value

    def click_drone(self, drone: int, **how: Any) -> None:
        """Click where it is drawn now."""
        x, y = self.value(
            f"""(() => {{ const {{ camera, recording, play }} = page, row = {drone} * 11, {{ drones }} = recording.at(play.time);
            const box = document.getElementById("field").getBoundingClientRect();
            return [box.x + camera.sx(drones[row]), box.y + camera.sy(drones[row + 1])]; }})()"""
        )
        self.page.mouse.click(x, y, **how)


@contextmanager
def command(*words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A command of rsc-swarm that serves a page: its process, and the address that it prints."""
    process = subprocess.Popen(
        [sys.executable, "-m", "rsc_swarm", *words, "--view-port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr
        said = []
        for line in process.stderr:
            said.append(line)
            if found := re.search(r"http://\S+?(?=[;\s]|$)", line):
                yield process, found.group()
                break
        else:
            raise AssertionError("".join(said))
    finally:
        process.terminate()
        process.communicate()
