"""Makes the README's pictures anew: `python -m tests.web.pictures docs/images`, or `make pictures`.

Simulates, audits and serves the demo plant, and looks at it in Chromium. The loop is the one that the README walks to.
"""

import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, sync_playwright

from app.cli.demo import at_the_top, audited, running_service
from app.cli.serve import listen
from app.services.addresses import tag_in_url
from app.services.demo import plant, write_exports

NAMES = ("chromium", "chromium-browser", "google-chrome")
WORST = "/loops/{worst}"
WIDTH = 1280
SMALLER = 0.625  # 800 points wide: what stands in the README
BREATH_MS = 500


@dataclass(frozen=True)
class Picture:
    """A page, how much of it is seen, and what stands at its top."""

    name: str
    path: str
    height: int
    scheme: Literal["light", "dark"] = "light"
    top: str = "body"


PICTURES = (
    Picture("plant", "/", 1130),
    Picture("table", "/table", 985),
    Picture("loop", WORST, 1400),
    Picture("charts", WORST, 1230, "dark", "figure:has(#pv-op)"),
)


def take(browser: Browser, url: str, worst: str, picture: Picture, folder: Path) -> None:
    page = browser.new_page(
        base_url=url,
        viewport={"width": WIDTH, "height": picture.height},
        color_scheme=picture.scheme,
        device_scale_factor=SMALLER,
    )
    page.goto(picture.path.format(worst=tag_in_url(worst)))
    for drawn in ("#treemap", "#charts"):
        if page.locator(drawn).count():
            page.locator(drawn).scroll_into_view_if_needed()
            page.wait_for_selector(f"{drawn}[data-drawn=yes]")
    page.locator(picture.top).evaluate("part => scrollTo(0, part.getBoundingClientRect().top + scrollY - 20)")
    page.wait_for_timeout(BREATH_MS)
    page.screenshot(path=folder / f"{picture.name}.png")
    page.close()


def main(folder: Path) -> None:
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        sys.exit("no Chromium on this machine: `make browser` installs it")
    loops = plant()
    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        exports = write_exports(Path(place) / "exports", loops)
        with running_service(Path(place) / "data", listen("127.0.0.1", 0, at_once=True)) as client:
            audited(client, exports, loops)
            worst = at_the_top(client)
            browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
            for picture in PICTURES:
                take(browser, client.url, worst, picture, folder)
            browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
