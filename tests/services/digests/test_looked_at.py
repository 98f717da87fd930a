"""What the doctor says of the way a digest goes."""

import socket
from typing import Any

import pytest

from app.cli.digest import sent
from app.cli.messages import ExitCode
from app.services.backend import Backend
from app.services.digests import deliveries, webhooks
from app.services.upkeep import doctor
from app.services.upkeep.sweep import sweep
from app.settings import Settings
from tests.services.digests.conftest import (
    deliver_all,
    states,
)


def test_the_doctor_says_what_is_missing(backend: Backend) -> None:
    assert doctor.digests(backend).state == "ok"
    bare = Settings(data_dir=backend.settings.data_dir, digest_mail_to="a@b", digest_webhooks="https://x.example/")
    found = doctor.digests(Backend(bare, backend.database, backend.queue))
    assert found.state == "problem"
    for name in ("SMTP_HOST", "MAIL_FROM", "WEBHOOK_SECRET"):
        assert f"LOOPAUDIT_DIGEST_{name}" in found.found


def test_the_doctor_warns_of_a_name_that_leads_inside_or_nowhere(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    def resolved(host: str, *_: object, **__: object) -> list[Any]:
        if host == "nowhere.example":
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return [(2, 1, 6, "", ("10.0.0.1", 443))]

    def advised(**changed: object) -> doctor.Check:
        settings = backend.settings.model_copy(update=changed)
        return doctor.digests(Backend(settings, backend.database, backend.queue))

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    inside = {"digest_webhooks": "https://hooks.inside.example/hidden"}
    found = advised(**inside, digest_private_webhooks=False)
    assert (found.state, "hooks.inside.example is a private" in found.found) == ("warning", True)
    assert advised(**inside, digest_private_webhooks=True).state == "ok"
    lost = advised(digest_webhooks="https://nowhere.example/hidden")
    assert (lost.state, lost.found) == (
        "warning",
        "https://nowhere.example/... is not found: Name or service not known",
    )
    assert "mail server nowhere.example is not found" in advised(digest_smtp_host="nowhere.example").found


@pytest.mark.parametrize("label", ["", "a" * 64])
def test_a_name_that_cannot_be_looked_up_is_told_and_not_raised(backend: Backend, night: str, label: str) -> None:
    """Settings refuse it now."""
    host = f"mail.{label}.example.com"
    wrong = {"digest_smtp_host": host, "digest_webhooks": f"https://{host}/hidden"}
    lost = Backend(backend.settings.model_copy(update=wrong), backend.database, backend.queue)
    told = list(deliveries.out_of_reach(lost))
    assert told == [
        f"the mail server {host} is not found: this is no name",
        f"https://{host}/... is not found: this is no name",
    ]
    assert doctor.digests(lost).state == "warning"
    assert sent(lost, night) is ExitCode.SOME_FAILED
    reasons = {str(one.reason) for one in deliveries.deliveries_of(lost, night)}
    assert reasons == {
        f"the mail server {host} has a name that is none",
        "the receiver cannot be reached: UnicodeError",
    }


def test_a_webhook_that_may_not_go_inside_is_a_problem_and_given_up(backend: Backend, night: str) -> None:
    """The service starts all the same."""
    kept_out = backend.settings.model_copy(update={"digest_private_webhooks": False, "digest_mail_to": ""})
    inside = Backend(kept_out, backend.database, backend.queue)
    found = doctor.digests(inside)
    assert (found.state, found.advice) == ("problem", "LOOPAUDIT_DIGEST_PRIVATE_WEBHOOKS=true allows these")
    assert "no webhook goes to 127.0.0.1" in found.found
    sweep(inside)
    deliver_all(inside)
    assert states(inside, night)["http"] == ("failed", 1)


@pytest.mark.parametrize(
    ("secret", "key", "state"),
    [
        ("whsec_" + "AAEC" * 8, bytes([0, 1, 2]) * 8, "ok"),
        ("whsec_-_8=", b"whsec_-_8=", "warning"),  # url-safe
        ("whsec_AAECAw", b"whsec_AAECAw", "warning"),  # without its padding
        ("whsec_a word", b"whsec_a word", "warning"),
        ("whsec_Schl\u00fcssel", "whsec_Schl\u00fcssel".encode(), "warning"),
        ("a word", b"a word", "ok"),
    ],
)
def test_a_secret_signs_as_it_always_did_and_the_doctor_tells_how(
    backend: Backend, secret: str, key: bytes, state: str
) -> None:
    assert webhooks.key_of(secret) == key
    changed = {"digest_webhook_secret": Settings(digest_webhook_secret=secret).digest_webhook_secret}
    found = doctor.digests(Backend(backend.settings.model_copy(update=changed), backend.database, backend.queue))
    assert found.state == state
    assert secret not in repr(found)
