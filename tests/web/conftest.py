"""A small audited plant with hostile names, and the pages on it."""

import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from html.parser import HTMLParser

import pytest
from playwright.sync_api import BrowserContext, Error, Page, ViewportSize, sync_playwright

from app.main import create_app
from app.services.addresses import tag_in_url
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive
from tests import swinging

HOSTILE = "=A 1/<script>alert('x')</script>\"&?#%2F"
PATIENCE_MS = 20_000  # a busy machine takes its time to parse the chart library
WIDE: ViewportSize = {"width": 1280, "height": 900}
NARROW: ViewportSize = {"width": 360, "height": 740}
NAMES = ("chromium", "chromium-browser", "google-chrome")
TAGS = ("FIC101", "LIC7", HOSTILE)
HOSTILE_PAGE = f"/loops/{tag_in_url(HOSTILE)}"
PAGES = [
    "/",
    "/table",
    "/groups",
    "/nights",
    "/glossary",
    "/runs",
    "/runs/1",
    "/uploads",
    "/uploads/1",
    "/loop-list",
    "/loops/FIC101",
    HOSTILE_PAGE,
]


class Seen(HTMLParser):
    """Scripts, links, texts, and what a strict content policy forbids."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.scripts, self.texts, self.links, self.forbidden = [], [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag == "script":
            self.scripts.append(given.get("src"))
        if tag == "a":
            self.links.append(given["href"])
        self.forbidden += [name for name in given if name == "style" or name.startswith("on")]
        self.forbidden += [tag] if tag in ("style", "b-evil") else []

    def handle_data(self, data):
        self.texts.append(data)


def seen(client, path: str) -> Seen:
    answer = client.get(path)
    assert answer.status_code == 200, answer.text[:300]
    return Seen(answer.text)


# Markup in a cell that is no number.
wide = partial(swinging.wide, samples=600, unreadable="Bad <b>Input</b>")


@pytest.fixture(scope="module")
def web_backend(open_plant) -> Backend:
    warm_up()
    backend = open_plant()
    with receive(backend, filename="<i>plant.csv") as receiving:
        receiving.write(wide(*TAGS))
        receipt = receiving.commit()
    read_upload(backend, int(receipt.upload.id), "test")
    audit_chunk(backend, int(start_audit(backend, LoopFilter()).id), "test")
    return backend


@pytest.fixture(scope="module")
def client(serve, web_backend):
    with serve(create_app(web_backend.settings)) as found:
        yield found


class Pages:
    """Opens pages in one Chromium for each server, which keeps what it has compiled of the chart library: in a context
    of its own each page would compile it anew, for twice the time.
    """

    def __init__(self, launch: Callable[[str], BrowserContext]) -> None:
        self.launch, self.contexts = launch, dict[str, BrowserContext]()

    def open(self, address: str = "", size: ViewportSize = WIDE) -> Page:
        """A page of this size on the server at this address, or on none, with no cookies from before."""
        if address not in self.contexts:
            self.contexts[address] = self.launch(address)
        self.contexts[address].clear_cookies()
        page = self.contexts[address].new_page()
        page.set_viewport_size(size)
        page.set_default_timeout(PATIENCE_MS)
        return page

    def close(self) -> None:
        for context in self.contexts.values():
            context.close()


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pages]:
    found = next(filter(None, map(shutil.which, NAMES)), None)
    required = os.environ.get("LOOPAUDIT_TEST_REQUIRE_BROWSER") == "1"
    if found is None:
        text = "no Chromium on this machine"
        pytest.fail(f"{text}, and LOOPAUDIT_TEST_REQUIRE_BROWSER is set") if required else pytest.skip(text)
    with sync_playwright() as playwright:

        def launch(address: str) -> BrowserContext:
            profile = tmp_path_factory.mktemp("profile")
            try:
                # In a container there is no sandbox to be had; the pages are our own.
                return playwright.chromium.launch_persistent_context(
                    profile, executable_path=found, args=["--no-sandbox"], base_url=address or None
                )
            except Error as error:
                if required:
                    raise
                pytest.skip(f"Chromium does not start here: {str(error)[:200]}")

        pages = Pages(launch)
        yield pages
        pages.close()
