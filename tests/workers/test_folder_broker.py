"""The broker that is a folder: messages whole or not there, each taken once, nothing that cannot be read does harm."""

import threading
from pathlib import Path
from queue import Empty
from typing import Any

import pytest
from kombu import Connection

from app.queue import Queue, folder
from app.queue.application import celery_application
from app.services.intake import uploads
from app.settings import Settings


@pytest.fixture
def channel(tmp_path: Path) -> folder.Channel:
    celery_application(Settings(data_dir=tmp_path))  # knows the name of the transport
    connection = Connection("folder://localhost", transport_options={"folder": str(tmp_path / "broker")})
    return connection.default_channel


def message(number: int) -> dict[str, object]:
    return {"body": str(number), "properties": {}, "headers": {}}


def taken(channel: folder.Channel, queue: str) -> list[str]:
    found = []
    while True:
        try:
            found.append(channel._get(queue)["body"])
        except Empty:
            return found


def test_messages_come_in_order_and_once(channel: folder.Channel) -> None:
    for number in range(5):
        channel._put("audit", message(number))
    assert channel._size("audit") == 5
    assert taken(channel, "audit") == ["0", "1", "2", "3", "4"]
    assert channel._size("audit") == 0


def test_its_folders_are_for_their_owner_alone(channel: folder.Channel) -> None:
    taken(channel, "audit")
    whole = Path(channel.transport_options["folder"])
    assert {path.stat().st_mode & 0o777 for path in (whole, *whole.iterdir())} == {0o700}


def test_queues_are_apart(channel: folder.Channel) -> None:
    channel._put("audit", message(1))
    channel._put("control", message(2))
    assert channel._purge("audit") == 1
    assert taken(channel, "control") == ["2"]


def test_what_cannot_be_read_is_dropped(channel: folder.Channel, tmp_path: Path) -> None:
    waiting = tmp_path / "broker" / "waiting"
    channel._put("audit", message(1))
    for name, content in {"0": "", "1": '{"bod', "2": "[]", "3": '{"body": 1}'}.items():
        (waiting / f"0000_{name}.audit.msg").write_text(content)
    (waiting / "0000_4.audit.msg").write_bytes(b'{"body": "\xff\xfe", "properties": {}}')
    (waiting / "0000_5.audit.msg").write_text("[" * 100_000)
    assert taken(channel, "audit") == ["1"]
    assert list(waiting.iterdir()) == []
    assert list((tmp_path / "broker" / "taken").iterdir()) == []


def test_what_a_process_left_half_done_is_swept_at_the_start(
    channel: folder.Channel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was ended between taking a message and reading it, or between writing one and giving it its name."""
    broker = tmp_path / "broker"
    channel._put("audit", message(1))
    (broker / "taken" / "99_0000.audit.msg").write_text("{}")
    (broker / "waiting" / ".0000.audit.msg.5f").write_text("{")
    channel.connection.create_channel(channel.connection)
    assert len(list(broker.rglob("*0000*"))) == 2  # somebody may be at it
    monkeypatch.setattr(folder, "LEFT_AFTER_S", -60.0)
    channel.connection.create_channel(channel.connection)
    assert list(broker.rglob("*0000*")) == []
    assert taken(channel, "audit") == ["1"]


def test_a_message_is_taken_by_one(channel: folder.Channel) -> None:
    for number in range(100):
        channel._put("audit", message(number))
    found: list[str] = []
    threads = [threading.Thread(target=lambda: found.extend(taken(channel, "audit"))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found, key=int) == [str(number) for number in range(100)]


def test_without_a_worker_the_folder_does_not_fill_up(channel: folder.Channel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder, "MOST_WAITING", 3)
    for number in range(5):
        channel._put("control", message(number))
    assert channel._size("control") == 3


def test_only_the_owner_sees_messages(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path / "data")
    settings.prepare_folders()
    queue = Queue(settings)
    assert queue.audit_chunks(1, 2)
    assert queue.reachable()
    queue.close()
    parts = [settings.data_dir, *(settings.data_dir / "broker").iterdir()]
    assert {part.stat().st_mode & 0o077 for part in parts} == {0}
    assert len(list((settings.data_dir / "broker" / "waiting").glob("*-audit.msg"))) == 2


def test_a_broken_table_of_queues_is_written_anew(channel: folder.Channel) -> None:
    channel._queue_bind("control", "audit", "", "audit")
    channel._table("control").write_text("[[")
    assert channel.get_table("control") == []
    channel._queue_bind("control", "audit", "", "audit")
    channel._queue_bind("control", "audit", "", "audit")
    assert [row.queue for row in channel.get_table("control")] == ["audit"]


def test_folders_above_it_that_are_away_are_not_made_anew(tmp_path: Path) -> None:
    """As with a share: what is made in its place would be hidden once it is back."""
    data, away = tmp_path / "data", tmp_path / "away"
    celery_application(Settings(data_dir=data))
    channel = Connection("folder://localhost", transport_options={"folder": str(data / "broker")}).default_channel
    channel._put("audit", message(1))
    data.rename(away)
    with pytest.raises(FileNotFoundError):
        channel._put("audit", message(2))
    assert not data.exists()
    away.rename(data)
    assert taken(channel, "audit") == ["1"]


@pytest.mark.parametrize("plant", ["embedded"], indirect=True)
def test_a_worker_whose_folder_is_away_for_a_while_goes_on(plant: Any, small_export: bytes) -> None:
    data = plant.backend.settings.data_dir
    away, told = data.with_name(f"{data.name}-away"), plant.log.relative_to(data)
    worker = plant.start("worker")
    first = plant.send("a.csv", small_export)
    plant.wait("the first upload", lambda: uploads.get_upload(plant.backend, first.id).state == "done")
    data.rename(away)
    try:
        plant.wait("its absence", lambda: "the folder of messages cannot be used" in (away / told).read_text())
    finally:
        away.rename(data)
    second = plant.send("b.csv", small_export.replace(b"FIC", b"TIC"))
    plant.wait("the second upload", lambda: uploads.get_upload(plant.backend, second.id).state == "done")
    assert worker.exitcode is None
    assert plant.log.read_text().count("the folder of messages cannot be used") == 1
