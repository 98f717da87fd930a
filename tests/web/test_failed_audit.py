"""A loop whose newest audit failed: its page says so, and why, until one has not failed."""

from urllib.parse import quote

import pytest

from app.errors import DataError
from app.services.auditing import chunks
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.intake.reading import read_upload
from app.services.intake.uploads import receive
from app.services.reports.documents import loop_report
from tests.web.conftest import HOSTILE, wide

NEW = "TIC9"
WHY = "valve <b>9</b> & more"


@pytest.fixture
def failed(web_backend, monkeypatch) -> int:
    """A run of an audited loop and of a new one, both of which fail."""
    with receive(web_backend, filename="new.csv") as receiving:
        receiving.write(wide(NEW))
        upload = receiving.commit().upload
    read_upload(web_backend, int(upload.id), "test")

    def spoiled(*_: object) -> None:
        raise DataError("odd", WHY)

    with monkeypatch.context() as patched:
        patched.setattr(chunks, "audit", spoiled)
        run = int(start_audit(web_backend, LoopFilter((HOSTILE, NEW))).id)
        audit_chunk(web_backend, run, "test")
    return run


def page(client, tag: str) -> str:
    answer = client.get(f"/loops/{quote(tag, safe='')}")
    assert answer.status_code == 200
    return " ".join(answer.text.split())


def test_a_failed_audit_is_told_with_its_run_and_reason(client, web_backend, failed):
    why = "valve &lt;b&gt;9&lt;/b&gt; &amp; more"
    said = f'Its newest audit, in <a href="/runs/{failed}">run {failed}</a>, failed: {why}.'
    before = "What follows is from the audit before."
    old, new, untouched = page(client, HOSTILE), page(client, NEW), page(client, "FIC101")
    assert f"{said} {before}" in old
    assert 'class="verdict"' in old
    assert said in new
    assert before not in new
    assert "not been audited" not in new
    assert "Its newest audit" not in untouched
    report = loop_report(web_backend, HOSTILE)
    assert f"<b>Its newest audit, in run {failed}, failed:</b> {why}. {before}" in report
    assert "Its newest audit" not in loop_report(web_backend, "FIC101")

    audit_chunk(web_backend, int(start_audit(web_backend, LoopFilter((HOSTILE, NEW))).id), "test")
    for tag in (HOSTILE, NEW):
        assert "Its newest audit" not in page(client, tag)
        assert 'class="verdict"' in page(client, tag)


def test_failures_that_are_not_shown_are_counted(client, failed, monkeypatch):
    assert "more failed" not in client.get(f"/runs/{failed}").text
    monkeypatch.setattr("app.web.runs.SHOWN_FAILURES", 1)
    assert "The first 1 are listed; 1 more failed." in client.get(f"/runs/{failed}").text
