"""In a browser: the pages keep the content security policy, and a person can log in, look, and log out."""

import re
import shutil
from collections.abc import Iterator
from datetime import timedelta

import pytest

from app.main import create_app
from app.services.access import keys
from app.services.access.identity import Role
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.warming import warm_up
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive

sync_api = pytest.importorskip("playwright.sync_api")

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
VIOLATIONS = """
window.violations = [];
document.addEventListener("securitypolicyviolation", (event) =>
  window.violations.push(`${event.effectiveDirective} ${event.blockedURI} ${event.sourceFile}:${event.lineNumber}`));
"""
EXPORT = b"DateTime,FIC1.PV,FIC1.OP,FIC1.SP\n" + b"".join(
    f"2026-01-01T{k // 60:02d}:{k % 60:02d}:00Z,{50 + (k % 40) / 20 + k % 3 * 0.1},{40 + k % 40},50\n".encode()
    for k in range(400)
)


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator["sync_api.Page"]:
    program = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip("no Chromium on this machine")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        opened = browser.new_page()
        opened.add_init_script(VIOLATIONS)
        yield opened
        browser.close()


@pytest.fixture(scope="module")
def plant(serve, open_plant) -> Iterator[tuple[str, str]]:
    """A plant of one audited loop that asks for keys: its address, and a key of an administrator."""
    warm_up()
    backend = open_plant(require_keys=True)
    with receive(backend, filename="plant.csv") as receiving:
        receiving.write(EXPORT)
        upload = receiving.commit().upload
    read_upload(backend, int(upload.id), owner="test")
    audit_chunk(backend, int(start_audit(backend).id), "test")
    key = keys.create_key(backend, "me", Role.admin, lifetime=timedelta(days=1)).text
    with serve(create_app(backend.settings)) as client:
        yield str(client.base_url), key


def test_a_person_logs_in_looks_and_logs_out_and_no_page_breaks_the_policy(page, plant):
    address, key = plant
    broken: list[str] = []
    page.on("console", lambda said: broken.append(said.text) if "Content Security Policy" in said.text else None)
    page.on("pageerror", lambda error: broken.append(str(error)))
    refused: list[str] = []
    page.on("requestfailed", lambda request: refused.append(request.url))

    page.goto(f"{address}/loops/FIC1")
    assert re.search(r"/login\?next=", page.url)
    page.fill("#key", "la_read_wrong")
    page.press("#key", "Enter")
    page.wait_for_selector("[role=alert]")
    page.fill("#key", key)
    page.press("#key", "Enter")
    page.wait_for_selector("#trend .main-svg", timeout=30_000)
    assert page.url == f"{address}/loops/FIC1"
    for path in ("/", "/loops/FIC1", "/loops/FIC1/explanation", "/login"):
        page.goto(address + path)
        page.wait_for_load_state("networkidle")
        assert page.evaluate("window.violations") == [], path
    cookie = next(cookie for cookie in page.context.cookies() if cookie["name"] == "loopaudit_session")
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
    assert page.evaluate("document.cookie") == ""

    page.goto(address + "/")
    page.wait_for_load_state("networkidle")  # what is still on its way when a page is left counts as refused
    page.click("form.who button")
    page.wait_for_url("**/login")
    page.goto(address + "/")
    assert "/login" in page.url
    assert broken == []
    assert refused == []


def test_another_site_can_neither_read_nor_change_in_the_name_of_who_is_logged_in(page, plant):
    """The other site is the same service by another name, whose pages a browser holds for foreign."""
    address, key = plant
    page.goto(f"{address}/login")
    page.fill("#key", key)
    page.press("#key", "Enter")
    page.wait_for_url(f"{address}/")
    page.route("http://evil.test/**", lambda route: route.fulfill(body="<p>evil</p>", content_type="text/html"))
    page.goto("http://evil.test/")
    sent = """async ([address, method]) => {
      const how = {method, mode: "no-cors", credentials: "include"};
      try { const answer = await fetch(address, how); return answer.type; }
      catch (error) { return "refused"; }
    }"""
    page.evaluate(sent, [f"{address}/v1/audits", "POST"])
    assert page.evaluate(sent, [f"{address}/v1/loops", "GET"]) == "refused"
    page.goto(f"{address}/")
    runs = page.evaluate("async () => (await (await fetch('/v1/audits')).json()).rows.length")
    assert runs == 1
