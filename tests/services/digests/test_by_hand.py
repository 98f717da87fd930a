"""A digest that somebody sends by hand: what was given up, once more to who has it, and which run it is of."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import update
from typer.main import get_command
from typer.testing import CliRunner

from app.cli.digest import sent
from app.cli.main import cli
from app.cli.messages import ExitCode
from app.errors import RequestError
from app.services.access.trail import list_trail
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.digests import deliveries
from app.services.digests.digest import Digest
from app.services.digests.making import digest_of, run_to_tell
from app.services.upkeep import doctor
from app.services.upkeep.sweep import sweep
from app.storage.tables import audits
from tests.services.digests.conftest import (
    AddLoops,
    Mailbox,
    Receiver,
    deliver_all,
    let_time_pass,
    states,
)


def test_what_was_given_up_is_sent_by_hand_once_its_reason_is_mended(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, capsys: pytest.CaptureFixture[str]
) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    assert f"`loopaudit digest --send --audit {night}`" in doctor.digests(backend).advice
    assert sent(backend, night) is ExitCode.SOME_FAILED
    receiver.answers = 204
    assert sent(backend, night) is ExitCode.DONE
    assert states(backend, night) == {"mailto": ("done", 1), "http": ("done", 1)}
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 1
    assert len(mailbox.mails) == 1
    assert doctor.digests(backend).state == "ok"
    told = capsys.readouterr().out
    assert "the receiver answered 404" in told
    assert "mailto:you@example.com: already delivered at 20" in told


def test_the_trail_names_who_had_it_sent(backend: Backend, night: str, receiver: Receiver) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    assert sent(backend, night, again=True) is ExitCode.SOME_FAILED
    told = list_trail(backend, action=deliveries.ACTION).rows
    assert sorted((row.who, row.outcome, row.detail["via"]) for row in told) == [
        (who, outcome, who) for who in ("command line", "schedule") for outcome in ("done", "failed")
    ]


def test_what_is_taken_up_by_hand_has_all_its_tries_again(backend: Backend, night: str, receiver: Receiver) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    receiver.answers = 500
    assert sent(backend, night) is ExitCode.SOME_FAILED
    assert states(backend, night)["http"] == ("open", 1)


def test_who_has_it_gets_it_again_where_that_is_wanted(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, capsys: pytest.CaptureFixture[str]
) -> None:
    assert sent(backend, night) is ExitCode.DONE
    assert sent(backend, night) is ExitCode.DONE
    assert (len(mailbox.mails), len(receiver.posts)) == (1, 1)
    assert capsys.readouterr().out.count("already delivered at ") == 2
    assert sent(backend, night, again=True) is ExitCode.DONE
    assert "already" not in capsys.readouterr().out
    # Mail servers and careful receivers drop what they know by its id.
    assert len({mail["Message-ID"] for mail in mailbox.mails}) == 2
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 2
    assert {json.loads(body)["id"] for _, body in receiver.posts} == {
        heads["webhook-id"] for heads, _ in receiver.posts
    }


def test_a_digest_is_made_once_for_all_who_get_it(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    def counted(of: Backend, run: str) -> Digest:
        made.append(run)
        return digest_of(of, run)

    monkeypatch.setattr(deliveries, "digest_of", counted)
    assert sent(backend, night) is ExitCode.DONE
    assert (len(mailbox.mails), len(receiver.posts)) == (1, 1)
    assert made == [night]


def test_what_is_sent_once_more_keeps_its_new_id_at_every_try(backend: Backend, night: str, receiver: Receiver) -> None:
    assert sent(backend, night) is ExitCode.DONE
    receiver.answers = 500
    assert sent(backend, night, again=True) is ExitCode.SOME_FAILED
    receiver.answers = 404
    let_time_pass(backend)
    deliver_all(backend)  # by the service
    assert states(backend, night)["http"] == ("failed", 2)
    receiver.answers = 204
    assert sent(backend, night) is ExitCode.DONE
    first, *later = [heads["webhook-id"] for heads, _ in receiver.posts]
    assert (len(later), len({*later})) == (3, 1)
    assert later[0].startswith(f"{first}-")


def test_a_worker_that_is_faster_than_the_command_sends_with_the_new_id_too(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert sent(backend, night) is ExitCode.DONE
    own = deliveries.deliver_next

    def overtaken(*arguments: Any) -> bool:
        while own(backend, "a worker"):
            pass
        return own(*arguments)

    with monkeypatch.context() as busy:
        busy.setattr(deliveries, "deliver_next", overtaken)
        assert sent(backend, night, again=True) is ExitCode.DONE
    assert (len(mailbox.mails), len(receiver.posts)) == (2, 2)
    assert len({mail["Message-ID"] for mail in mailbox.mails}) == 2
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 2


def test_a_dry_run_sends_nothing_again(
    backend: Backend, night: str, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def same() -> Iterator[Backend]:
        yield backend

    def done(*options: str) -> int:
        return CliRunner().invoke(cli, ["digest", *options]).exit_code

    monkeypatch.setattr("app.cli.digest.opened", same)
    refused = CliRunner().invoke(cli, ["digest", "--dry-run", "--again"]).exception
    assert isinstance(refused, RequestError)  # exit code 2, of `main`
    assert refused.code == "dry_run_sends"
    assert (done("--dry-run"), done()) == (0, 0)
    assert receiver.posts == []
    assert (done("--send"), done("--again"), done("--again", "--send")) == (0, 0, 0)
    assert len(receiver.posts) == 3


def test_who_stands_no_longer_in_the_settings_is_not_complained_of(
    backend: Backend, night: str, receiver: Receiver
) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    fewer = Backend(backend.settings.model_copy(update={"digest_webhooks": ""}), backend.database, backend.queue)
    assert doctor.digests(fewer).state == "ok"
    assert sent(fewer, night) is ExitCode.DONE


def test_without_a_night_the_digest_is_that_of_a_run_of_the_plant(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    assert run_to_tell(backend) == run.id
    (said,) = [option.help for option in get_command(cli).commands["digest"].params if option.name == "audit"]
    assert "if no night began in the 24 hours before" in said


def test_a_night_within_the_day_before_is_told_of_by_when_it_began(backend: Backend, night: str) -> None:
    asked_for = start_audit(backend).id
    audit_chunk(backend, int(asked_for), "test")
    with backend.database.write() as connection:
        began = update(audits).where(audits.c.id == int(night))
        connection.execute(began.values(created_at=datetime.now(UTC) - timedelta(hours=23)))
        assert run_to_tell(backend) == night
        connection.execute(began.values(created_at=datetime.now(UTC) - timedelta(hours=25)))
    assert run_to_tell(backend) == asked_for  # the night has ended just now
