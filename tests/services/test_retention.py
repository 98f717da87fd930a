"""Retention on both databases: what is old goes, what is young or still needed stays."""

import errno
import os
import time
from concurrent.futures import Future, ThreadPoolExecutor, wait
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import insert, select, update

from app.errors import RequestError
from app.services.access import trail
from app.services.access.identity import SCHEDULE
from app.services.backend import Backend
from app.services.intake import drafts, uploads
from app.services.intake.reading import read_upload
from app.services.plant.loop_verdicts import loop_health, verdict_history
from app.services.results import Receipt
from app.services.upkeep import retention
from app.services.upkeep.metrics import Sample, metrics
from app.services.upkeep.sweep import drop_old_drafts, sweep
from app.storage import retention as stored_retention
from app.storage import tables
from app.storage import uploads as stored_uploads
from tests.services.upkeep_plant import EXPORT, aged, audited_twice, count, with_settings


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Backend:
    return audited_twice(backend)


def test_what_is_young_stays(plant):
    before = {name: count(plant, name) for name in ("series", "verdicts", "verdict_details", "audits", "uploads")}
    retention.retain(plant)
    assert {name: count(plant, name) for name in before} == before
    assert list(plant.settings.uploads_dir.iterdir())


def test_old_verdicts_go_and_the_newest_of_a_loop_stays(plant):
    newest = loop_health(plant, "FIC1")
    aged(plant, 100_000)
    dropped = retention.retain(plant)
    assert dropped["details"] == 1
    assert dropped["verdicts"] >= 1
    assert [row["audit_id"] for row in verdict_history(plant, "FIC1").rows] == [newest["audit_id"]]
    assert loop_health(plant, "FIC1") == newest
    assert count(plant, "audits") == 1
    assert count(plant, "verdict_details") == 1


def test_details_go_before_their_verdicts(plant):
    aged(plant, plant.settings.keep_details_days + 1)
    retention.retain(plant)
    assert (count(plant, "verdicts"), count(plant, "verdict_details")) == (2, 1)


def test_series_go_by_the_time_before_the_newest_sample_of_their_loop(plant):
    kept = with_settings(plant, keep_series_days=7, window_h=24)
    with plant.database.write() as connection:
        old = connection.execute(select(tables.series)).mappings().one()
        day_ns = 86_400_000_000_000
        times = [name for name, value in old.items() if name.endswith("_ns") and value is not None]
        for days in (9, 8, 6):  # that of 8 days says which set point held when what is kept begins
            moved = {name: old[name] - days * day_ns for name in times}
            values = {name: value for name, value in old.items() if name != "id"} | moved
            connection.execute(insert(tables.series).values(values | {"fingerprint": str(days)}))
    assert retention.retain(kept)["series"] == 1
    with plant.database.read() as connection:
        assert set(connection.scalars(select(tables.series.c.fingerprint))) == {old["fingerprint"], "8", "6"}


def test_series_without_a_date_go_by_when_they_came(plant):
    kept = with_settings(plant, keep_series_days=7, window_h=24)
    with uploads.receive(plant, filename="step test.csv") as receiving:
        receiving.write(b"time,FIC1.PV,FIC1.OP\n" + b"".join(b"%d,%d,%d\n" % (k, k % 7, k % 5) for k in range(99)))
        read_upload(plant, int(receiving.commit().upload.id), "test")
    before = count(plant, "series")
    assert (retention.retain(kept)["series"], count(plant, "series")) == (0, before)
    aged(plant, 8)
    assert (retention.retain(kept)["series"], count(plant, "series")) == (1, before - 1)


def test_exports_that_were_read_go_and_those_to_be_read_stay(plant):
    with uploads.receive(plant, filename="waiting.csv") as receiving:
        receiving.write(EXPORT + b"2026-01-02T00:00:00Z,1,2,3\n")
        waiting = receiving.commit().upload.fingerprint
    orphan = plant.settings.uploads_dir / ("0" * 64)
    orphan.write_bytes(b"of no upload")
    aged(plant, 400)
    assert retention.retain(plant)["files"] == 2
    assert [file.name for file in plant.settings.uploads_dir.iterdir()] == [waiting]
    assert count(plant, "uploads") == 2


@pytest.mark.parametrize(("days", "gone"), [(-1, False), (1, True)])
@pytest.mark.parametrize(
    ("setting", "kind"),
    [("uploads", "files"), ("receipts", "uploads"), ("verdicts", "verdicts"), ("details", "details")],
)
def test_each_kind_is_kept_for_as_many_days_as_its_setting_says(plant, setting, kind, days, gone):
    others = {f"keep_{name}_days": 0 for name in ("uploads", "receipts", "verdicts", "details")}
    if setting == "receipts":
        others["keep_uploads_days"] = 1  # a receipt stays with its export
    aged(plant, 40 + days)
    dropped = retention.retain(with_settings(plant, **others | {f"keep_{setting}_days": 40}))
    assert bool(dropped[kind]) == gone


@pytest.mark.parametrize(("days", "gone"), [(-1, False), (1, True)])
def test_the_trail_is_kept_for_as_many_days_as_its_setting_says(plant, days, gone):
    aged(plant, 40 + days)
    assert bool(retention.retain(with_settings(plant, keep_trail_days=40))["trail"]) == gone


def sent_again(backend: Backend) -> None:
    """To be read otherwise: an upload of its own."""
    reading = uploads.ReadingOptions(time_zone="Asia/Tokyo")
    with uploads.receive(backend, filename="again.csv", reading=reading) as receiving:
        receiving.write(EXPORT)
        receiving.commit()


def test_bytes_that_come_again_while_retention_looks_at_the_old_ones_stay(plant, monkeypatch):
    """Retention has looked and is about to drop: who sends waits for it, then puts the bytes there anew."""
    aged(plant, 400)
    looked = iter(range(9))
    with ThreadPoolExecutor(1) as pool:
        sending: list[Future[None]] = []

        def old_then_sent(file: Path, seconds: float) -> bool:
            old = older_than(file, seconds)
            if next(looked) == 1:  # for the second time, under the lock
                sending.append(pool.submit(sent_again, plant))
                wait(sending, timeout=1)
            return old

        older_than = retention.older_than
        monkeypatch.setattr(retention, "older_than", old_then_sent)
        assert retention.retain(plant)["files"] == 1
        sending[0].result()
    assert [file.read_bytes() for file in plant.settings.uploads_dir.iterdir()] == [EXPORT]


def test_bytes_that_are_being_registered_stay_though_their_file_looks_old(plant, monkeypatch):
    """Who sends has put the bytes there and is about to register them: retention waits for it, then knows them."""
    aged(plant, 400)
    monkeypatch.setattr(retention, "older_than", lambda file, seconds: True)  # a clock that has jumped meanwhile
    registered = stored_uploads.receive
    with ThreadPoolExecutor(1) as pool:
        dropping: list[Future[dict[str, int]]] = []

        def dropped_then_registered(connection, values):
            dropping.append(pool.submit(retention.retain, plant))
            wait(dropping, timeout=1)
            return registered(connection, values)

        monkeypatch.setattr(stored_uploads, "receive", dropped_then_registered)
        sent_again(plant)
        assert dropping[0].result()["files"] == 0
    assert [file.read_bytes() for file in plant.settings.uploads_dir.iterdir()] == [EXPORT]


def test_old_uploads_go_in_pieces_and_what_was_read_from_them_stays(plant):
    counted = {metric.name: metric.samples for metric in metrics(plant)}
    refused = [stored_uploads.RejectRow(line, "bad_value", "no number", "") for line in range(5)]
    with plant.database.write() as connection:
        stored_uploads.replace_rejects(connection, 1, refused)
    aged(plant, plant.settings.keep_receipts_days + 1)
    before = [count(plant, name) for name in ("series", "loops")]
    pieces = list(iter(lambda: dropped_of_uploads(plant, batch=2), 0))
    assert pieces == [2, 2, 1, 1, 1, 1]  # of rejects, of loops, of series, the row
    assert [count(plant, name) for name in ("uploads", "rejects", "upload_loops")] == [0, 0, 0]
    assert [count(plant, name) for name in ("series", "loops")] == before
    assert uploads.list_uploads(plant).rows == []
    told = {metric.name: metric.samples for metric in metrics(plant)}
    name = "loopaudit_upload_bytes_total"  # a counter
    assert told[name] == counted[name] == (Sample(len(EXPORT)),)


def dropped_of_uploads(backend: Backend, batch: int) -> int:
    kept = backend.settings
    before = datetime.now(UTC) - timedelta(days=kept.keep_receipts_days)
    with backend.database.write() as connection:
        since = retention.oldest_export(kept)
        return stored_retention.drop_uploads(connection, before, batch, exports_since=since)


def test_what_comes_again_after_its_upload_went_is_a_new_upload_and_changes_nothing(plant):
    aged(plant, plant.settings.keep_receipts_days + 1)
    assert retention.retain(plant)["uploads"] == 3
    with uploads.receive(plant, filename="plant.csv") as receiving:
        receiving.write(EXPORT)
        receipt = receiving.commit()
    assert receipt.created
    read_upload(plant, int(receipt.upload.id), owner="test")
    again = uploads.get_upload(plant, receipt.upload.id)
    assert (again.state, again.loops, again.samples_added) == ("done", ["FIC1"], 0)


def sent_once_more(backend: Backend) -> Receipt:
    with uploads.receive(backend, filename="plant.csv") as receiving:
        receiving.write(EXPORT)
        return receiving.commit()


def test_what_comes_again_before_its_upload_went_has_an_address_that_lives_as_long_as_a_new_one(plant):
    """The row as long as a receipt, the bytes as long as an export; from then on, and not from the first time."""
    aged(plant, plant.settings.keep_receipts_days + 1)
    receipt = sent_once_more(plant)
    assert (receipt.upload.id, receipt.created) == ("1", False)
    for file in plant.settings.uploads_dir.iterdir():
        os.utime(file, (0, 0))
    dropped = retention.retain(plant)
    assert (dropped.get("uploads", 0), dropped["files"]) == (0, 0)
    kept = uploads.get_upload(plant, receipt.upload.id)
    assert (kept.loops, kept.sent_again_at) == (["FIC1"], receipt.upload.sent_again_at)
    with plant.database.write() as connection:
        ago = datetime.now(UTC) - timedelta(days=plant.settings.keep_receipts_days + 1)
        connection.execute(update(tables.uploads).values(sent_again_at=ago))
    retention.retain(plant)
    assert (count(plant, "uploads"), list(plant.settings.uploads_dir.iterdir())) == (0, [])


def test_what_comes_again_while_its_upload_goes_is_a_new_upload(plant):
    """Part of what is told of the old one is gone already, and the rest goes."""
    aged(plant, plant.settings.keep_receipts_days + 1)
    assert dropped_of_uploads(plant, batch=1) == 1
    receipt = sent_once_more(plant)
    assert (receipt.created, receipt.upload.state) == (True, "received")
    read_upload(plant, int(receipt.upload.id), owner="test")
    assert list(iter(lambda: dropped_of_uploads(plant, batch=1), 0)) == [1, 1]
    assert [upload.id for upload in uploads.list_uploads(plant).rows] == [receipt.upload.id]
    assert uploads.get_upload(plant, receipt.upload.id).loops == ["FIC1"]
    assert sent_once_more(plant).upload.id == receipt.upload.id


@pytest.mark.parametrize(
    ("state", "days_kept", "stays"), [("done", 30, 0), ("failed", 30, 0), ("received", 30, 1), ("done", 0, 1)]
)
def test_an_upload_stays_while_it_waits_or_its_export_is_kept(plant, state, days_kept, stays):
    aged(plant, plant.settings.keep_receipts_days + 1)
    with plant.database.write() as connection:
        connection.execute(update(tables.uploads).values(state=state))
    retention.retain(with_settings(plant, keep_uploads_days=days_kept))
    assert count(plant, "uploads") == count(plant, "upload_loops") == stays


def test_an_upload_that_is_to_be_read_again_stays_though_it_was_found_to_be_old(plant, monkeypatch):
    if plant.database.is_sqlite:
        pytest.skip("nobody else writes meanwhile")
    aged(plant, plant.settings.keep_receipts_days + 1)
    with plant.database.write() as connection:
        connection.execute(update(tables.uploads).values(state="failed", error_code="fault"))

    def sent_again_meanwhile(connection, fingerprint):
        with plant.database.write() as other:
            stored_uploads.try_again(other, 1)

    monkeypatch.setattr(stored_retention, "lock_bytes", sent_again_meanwhile)
    retention.retain(plant)
    assert uploads.get_upload(plant, "1").state == "received"


def test_nought_days_keep_for_ever(plant):
    names = ("series", "details", "verdicts", "explanations", "trail", "uploads", "receipts")
    for_ever = with_settings(plant, **{f"keep_{name}_days": 0 for name in names})
    aged(plant, 100_000)
    counted = ("series", "verdicts", "verdict_details", "audits", "uploads", "upload_loops", "trail")
    before = {name: count(plant, name) for name in counted}
    retention.retain(for_ever)
    assert {name: count(plant, name) for name in before} == before | {"trail": before["trail"] + 1}  # itself
    assert list(plant.settings.uploads_dir.iterdir())


def test_it_runs_once_a_night_in_batches_and_stands_in_the_trail(plant):
    aged(plant, 100_000)
    assert retention.retain_if_due(plant) is not None
    assert retention.retain_if_due(plant) is None
    assert retention.retain_if_due(plant, datetime.now(UTC) + timedelta(days=1)) is not None
    row = trail.list_trail(plant, action=retention.ACTION).rows[-1]
    assert (row.who, row.outcome, row.detail["details"]) == ("schedule", "done", 1)


def test_a_sweep_by_a_clock_that_was_ahead_does_not_count(plant):
    trail.record(plant, SCHEDULE, retention.ACTION, "", "done")
    with plant.database.write() as connection:
        connection.execute(update(tables.trail).values(at=datetime.now(UTC) + timedelta(days=400)))
    assert retention.retain_if_due(plant) is not None
    assert retention.retain_if_due(plant) is None


def test_without_time_left_the_rest_waits_for_the_next_sweep(plant):
    aged(plant, 100_000)
    assert "files" not in retention.retain(plant, budget_s=-1)
    assert not trail.list_trail(plant, action=retention.ACTION).rows


def test_what_takes_all_the_time_keeps_nothing_else_from_being_dropped(plant, monkeypatch):
    """The time of a sweep is up as soon as the series were looked at, at each sweep anew."""
    aged(plant, 100_000)
    monkeypatch.setattr(retention, "BUDGET_S", -1)
    rounds = [retention.retain_if_due(plant) for _ in range(9)]
    assert [dropped for dropped in rounds if dropped and "files" in dropped]
    assert rounds[-1] is None
    assert [count(plant, name) for name in ("verdict_details", "audits", "uploads")] == [1, 1, 0]
    assert not list(plant.settings.uploads_dir.iterdir())
    assert [row.outcome for row in trail.list_trail(plant, action=retention.ACTION).rows] == ["done"]


def test_of_two_at_once_none_takes_what_the_other_is_dropping_for_the_end(plant, monkeypatch):
    """The first drops one row and has no time for more; the second comes while that is not committed yet."""
    ago = datetime.now(UTC) - timedelta(days=plant.settings.keep_trail_days + 1)
    rows = [{"at": ago, "who": "me", "action": "old", "outcome": "done"}] * 3
    with plant.database.write() as connection:
        connection.execute(insert(tables.trail), rows)
    drop_trail, comes = stored_retention.drop_trail, iter([True])
    with ThreadPoolExecutor(1) as pool:
        second: list[Future[dict[str, int]]] = []

        def drop_then_another_comes(*arguments):
            dropped = drop_trail(*arguments)
            if next(comes, False):
                second.append(pool.submit(retention.retain, plant, batch=1))
                wait(second, timeout=1)
            return dropped

        monkeypatch.setattr(stored_retention, "drop_trail", drop_then_another_comes)
        assert retention.retain(plant, budget_s=-1, batch=1)["trail"] == 1
        assert second[0].result()["trail"] == 2
    assert not trail.list_trail(plant, action="old").rows


def test_what_is_no_export_among_them_is_left_alone(plant):
    folder = plant.settings.uploads_dir
    for name in ("lost+found", "old", "f" * 64):
        (folder / name).mkdir()
    (folder / "notes.txt").write_text("of an administrator")
    aged(plant, 400)
    assert retention.retain(plant)["files"] == 1
    assert {file.name for file in folder.iterdir()} == {"lost+found", "old", "f" * 64, "notes.txt"}


def test_a_folder_that_cannot_be_looked_into_is_not_done_with(plant):
    folder = plant.settings.uploads_dir
    folder.rename(folder.with_name("elsewhere"))
    with pytest.raises(RequestError) as refused:
        retention.retain(plant)
    assert refused.value.code == "no_exports_folder"


def test_the_sweeper_does_it(plant):
    aged(plant, 100_000)
    sweep(plant)
    assert count(plant, "audits") == 1


def test_the_sweeper_takes_away_what_broken_uploads_left_for_a_day(plant):
    folder, now = plant.settings.uploads_dir, time.time()
    kept = {file.name for file in folder.iterdir()}
    for name, hours in ((".part-old", 24.5), (".part-young", 23.5)):
        (folder / name).write_bytes(b"Time,A.PV")
        os.utime(folder / name, (now - 3600 * hours,) * 2)
    sweep(plant)
    assert {file.name for file in folder.iterdir()} == kept | {".part-young"}


def test_an_upload_that_comes_in_while_the_clock_jumps_by_days_is_not_taken_for_a_broken_one(plant):
    with uploads.receive(plant, filename="b.csv") as receiving:
        receiving.write(b"Time,B.PV,B.OP\n")
        (draft,) = plant.settings.uploads_dir.glob(".part-*")
        os.utime(draft, (time.time() - 48 * 3600,) * 2)
        sweep(plant)
        receiving.write(b"2026-03-01T00:00:00Z,1,2\n")
        upload = receiving.commit().upload
    assert (plant.settings.uploads_dir / upload.fingerprint).read_bytes().count(b"\n") == 2


def test_a_draft_that_cannot_be_opened_goes_by_its_age(plant, monkeypatch):
    """As one that a command of another user left: who has the folder may take it away."""
    folder, now = plant.settings.uploads_dir, time.time()
    opened = os.open

    def refuse(path, *arguments, **named):
        if Path(path).name.startswith(".part-"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return opened(path, *arguments, **named)

    for name, hours in ((".part-old", 24.5), (".part-young", 0.0)):
        (folder / name).write_bytes(b"Time,A.PV")
        os.utime(folder / name, (now - 3600 * hours,) * 2)
    monkeypatch.setattr(drafts.os, "open", refuse)
    sweep(plant)
    assert [file.name for file in folder.glob(".part-*")] == [".part-young"]


def test_the_sweeper_takes_no_lock_from_an_upload_that_begins(plant, monkeypatch):
    """It would have to try it with a lock of its own, and the upload asks for its lock only once."""
    tried = []
    monkeypatch.setattr(drafts.fcntl, "flock", lambda descriptor, how: tried.append(descriptor))
    (plant.settings.uploads_dir / ".part-begins").write_bytes(b"")
    drop_old_drafts(plant)
    assert tried == []


def test_what_goes_while_the_sweeper_looks_does_not_stop_it(plant, monkeypatch):
    """An upload that ends takes its draft away, another schedule an old export."""
    gone = [plant.settings.uploads_dir / name for name in (".part-gone", "0" * 64)]
    monkeypatch.setattr(Path, "glob", lambda folder, pattern: iter(gone))
    monkeypatch.setattr(Path, "iterdir", lambda folder: iter(gone))
    assert retention.retain(plant)["files"] == 0
    sweep(plant)
