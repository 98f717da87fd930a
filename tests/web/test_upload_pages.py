"""The pages of uploads: what was understood, what was refused, and a mapping that is corrected."""

import gzip

import pytest
from markupsafe import escape

from app.services.auditing.audits import cancel_audit, list_audits
from app.services.intake.reading import read_upload
from app.services.intake.uploads import list_uploads
from app.storage import uploads as stored_uploads
from tests.web.conftest import Seen, seen


def test_the_loops_of_an_upload_are_audited_from_its_page(client, web_backend):
    found = seen(client, "/uploads/1")
    assert "Audit these 3 loops now" in found.texts
    answer = client.post("/uploads/1/audit")
    assert answer.status_code == 303
    run = list_audits(web_backend).rows[0]
    assert answer.headers["location"] == f"/runs/{run.id}"
    assert run.total == 3
    cancel_audit(web_backend, run.id)


def test_an_upload_says_which_run_audited_its_loops(client):
    found = client.get("/uploads/1").text
    assert 'Audited since: 3 of its 3 loops in <a href="/runs/1">run 1</a>.' in found
    assert "next audit of the plant" not in found


def test_an_upload_shows_its_tags_and_what_was_refused(client):
    found = seen(client, "/uploads/1")
    assert "<i>plant.csv" in found.texts
    assert "FIC101.PV" in found.texts
    assert any("Bad <b>Input</b>" in text for text in found.texts)


def test_an_upload_that_waits_for_room_says_so_on_its_page_and_in_the_list(client, web_backend):
    answer = client.post("/v1/uploads", content=b"time,FIC9.PV,FIC9.OP\n0,1,2\n1,2,3\n").json()
    assert (answer["state"], answer["waits_for_room_since"]) == ("received", None)
    assert "no room" not in client.get(f"/uploads/{answer['id']}").text
    with web_backend.database.write() as connection:
        claim = stored_uploads.claim(connection, int(answer["id"]), "test", 40.0, 1)
        stored_uploads.wait(connection, claim, 20.0, for_room=True)
    since = client.get(f"/v1/uploads/{answer['id']}").json()["waits_for_room_since"]
    page = seen(client, f"/uploads/{answer['id']}").texts
    assert "waiting for room on the disk" in page
    assert any(text.startswith(f"Since {since[:10]} {since[11:16]} there is no room to read it.") for text in page)
    assert "waiting for room on the disk" in seen(client, "/uploads").texts
    folder = web_backend.settings.uploads_dir
    away = folder.rename(folder.with_name("away"))
    assert "The data folder of the service is missing" in client.get(f"/uploads/{answer['id']}").text
    away.rename(folder)
    assert "The data folder" not in client.get(f"/uploads/{answer['id']}").text
    read_upload(web_backend, int(answer["id"]), "test")
    assert "no room" not in client.get(f"/uploads/{answer['id']}").text


def test_an_upload_whose_file_no_worker_sees_says_so_on_its_page_and_in_the_list(client, web_backend):
    answer = client.post("/v1/uploads", content=b"time,FIC8.PV,FIC8.OP\n0,1,2\n1,2,3\n").json()
    with web_backend.database.write() as connection:
        assert stored_uploads.note_unseen(connection, int(answer["id"]), 20.0, 40.0)
    since = client.get(f"/v1/uploads/{answer['id']}").json()["waits_for_file_since"]
    page = seen(client, f"/uploads/{answer['id']}").texts
    assert "waiting: no worker sees its file" in page
    assert any(text.startswith(f"Since {since[:10]} {since[11:16]} no worker that was asked") for text in page)
    assert "waiting: no worker sees its file" in seen(client, "/uploads").texts
    read_upload(web_backend, int(answer["id"]), "test")
    assert "no worker" not in client.get(f"/uploads/{answer['id']}").text


def test_an_upload_that_came_damaged_is_marked_on_its_page_and_in_the_list(client, web_backend):
    rows = "".join(f"{k},{k * 7919 % 101},{k * 104729 % 97}\n" for k in range(20_000))
    sent = gzip.compress(f"time,FIC9.PV,FIC9.OP\n{rows}".encode())[:-500]
    answer = client.post("/v1/uploads", content=sent).json()
    read_upload(web_backend, int(answer["id"]), "test")
    assert client.get(f"/v1/uploads/{answer['id']}").json()["damaged"] is True
    for page in (f"/uploads/{answer['id']}", "/uploads"):
        assert "done, but the file arrived damaged" in seen(client, page).texts


def test_an_upload_that_failed_says_why_in_the_list(client, web_backend):
    long_name = "N" * 120
    for sent in (b'{"a": 1}', f"Time;{long_name}.PV;{long_name}.OP\n06:00:00;1;2\n06:00:01;1;2\n".encode()):
        read_upload(web_backend, int(client.post("/v1/uploads", content=sent).json()["id"]), "test")
    cells = [text for text in seen(client, "/uploads").texts if text.startswith("failed")]
    assert cells[1] == "failed: this is JSON, which is not read; CSV or TSV text, parquet or xlsx is needed"
    assert cells[0].startswith("failed: below the names Time, N")
    assert len(cells[0]) <= len("failed: ") + 160


def test_names_of_a_file_that_failed_are_no_markup_in_the_list(client, web_backend):
    name = "<img src=x onerror=alert(1)>"
    sent = f"Time;{name}.PV;{name}.OP\n06:00:00;1;2\n06:00:01;1;2\n".encode()
    read_upload(web_backend, int(client.post("/v1/uploads", content=sent).json()["id"]), "test")
    page = client.get("/uploads").text
    assert "&lt;img src=x" in page
    assert "<img src=x" not in page


def test_a_zone_that_a_file_names_is_no_markup_in_its_notes(client, web_backend):
    rows = "".join(f"2026-05-14 06:00:{k:02d},{k},{k % 7}\n" for k in range(60))
    sent = f"Time zone: <img src=x onerror=alert(1)>\nTime,FIC7.PV,FIC7.OP\n{rows}".encode()
    answer = client.post("/v1/uploads", content=sent).json()
    read_upload(web_backend, int(answer["id"]), "test")
    page = client.get(f"/uploads/{answer['id']}").text
    assert "Time zone: &lt;img src=x" in page
    assert "<img src=x" not in page


def test_what_is_to_be_checked_first_stands_first_among_the_notes(client, web_backend):
    rows = "".join(f"2026-05-14 06:00:{k:02d},{k},{k % 7}\n" for k in range(59, -1, -1))
    sent = f"Time zone: UTC+02:00\nTime,FIC7.PV,FIC7.OP\n{rows}".encode()
    answer = client.post("/v1/uploads", content=sent).json()
    read_upload(web_backend, int(answer["id"]), "test")
    page = client.get(f"/uploads/{answer['id']}").text
    first, other = page.index("<li><b>check this first, the file names a zone"), page.index("rows were not in order")
    assert first < other


def test_a_file_is_read_again_with_another_mapping(client, web_backend):
    answer = client.post("/uploads/1/mapping", data={"mapping": "tag,loop,signal\nLIC7.PV,LIC8,PV\nLIC7.OP,LIC8,OP\n"})
    assert answer.status_code == 303
    number = answer.headers["location"].rpartition("/")[2]
    assert number != "1"
    read_upload(web_backend, int(number), "test")
    assert "LIC8" in client.get(f"/v1/uploads/{number}").json()["loops"]
    assert client.post("/uploads/1/mapping", data={"mapping": "tag,loop,signal\nX,Y,Z\n"}).status_code == 422


@pytest.mark.parametrize(
    ("first", "said"),
    [
        (
            "2026-03-01 12:00:00",
            "from 2026-03-01 12:00 to 2026-03-01 12:01; their times were read as UTC.",
        ),
        (
            "2026-03-01T12:00:00+01:00",
            "from 2026-03-01 11:00 to 2026-03-01 11:01; the file states their time zone.",
        ),
        ("0", "Its times have no date."),
    ],
)
def test_an_upload_says_from_when_it_is_and_by_which_clock(client, web_backend, first, said):
    second = first.replace("12:00:", "12:01:") if ":" in first else "60"
    rows = f"time,T1.PV,T1.OP\n{first},1,2\n{second},2,3\n"
    number = client.post("/v1/uploads?filename=when.csv", content=rows).json()["id"]
    read_upload(web_backend, int(number), "test")
    assert said in client.get(f"/uploads/{number}").text


def test_a_mapping_is_kept_for_later_files_where_the_box_is_ticked_and_taken_back(client, web_backend):
    mapping = "tag,loop,signal\nLIC7.PV,LIC9,PV\nLIC7.OP,LIC9,OP\n"
    assert "For later files too" in client.get("/uploads/1").text
    client.post("/uploads/1/mapping", data={"mapping": mapping})
    assert "LIC7.PV as PV" not in client.get("/uploads").text
    client.post("/uploads/1/mapping", data={"mapping": mapping, "keep": "1"})
    assert "LIC7.OP as OP, LIC7.PV as PV" in client.get("/uploads").text
    assert client.post("/uploads/kept/forget", data={"loop": "LIC9", "file": ""}).status_code == 303
    assert "LIC7.PV as PV" not in client.get("/uploads").text
    assert client.post("/uploads/kept/forget", data={"loop": "LIC9", "file": ""}).status_code == 404


def test_a_file_can_be_sent_without_scripts(client, web_backend):
    answer = client.post("/uploads", files={"file": ("more.csv", b"time,PV,OP\n0,1,2\n1,2,3\n", "text/csv")})
    assert answer.status_code == 303
    assert list_uploads(web_backend).rows[0].filename == "more.csv"


def test_a_mapping_that_cannot_be_taken_is_shown_again_with_what_is_wrong(client):
    typed = "tag,loop,signal\nLIC7.PV,<b-evil>,SPEED\n"
    answer = client.post("/uploads/1/mapping", data={"mapping": typed}, headers={"Accept": "text/html"})
    assert answer.status_code in (400, 422)
    found = Seen(answer.text)
    assert any(text.startswith("Not read again: ") and "SPEED" in text for text in found.texts)
    assert found.forbidden == []
    assert str(escape(typed)) in answer.text
    assert 'name="keep" value="1" checked' not in answer.text  # the box was not ticked
    assert client.post("/uploads/99/mapping", data={"mapping": typed}).status_code == 404


def test_tags_and_refusals_that_are_not_shown_are_counted(client, monkeypatch):
    assert "all of them, JSON" not in client.get("/uploads/1").text
    monkeypatch.setattr("app.web.uploads.SHOWN_TAGS", 2)
    monkeypatch.setattr("app.web.uploads.SHOWN_REJECTS", 1)
    told = client.get("/v1/uploads/1").json()
    tags = sum(1 for loop in told["tags"] for name in ("pv", "op", "sp", "mode") if loop[name])
    page = client.get("/uploads/1").text
    assert f'{tags - 2} more tags: <a href="/v1/uploads/1">' in page
    assert f'{len(told["rejects"]) - 1} more with what was received: <a href="/v1/uploads/1">' in page
    assert page.count("<tr data-tag=") == 2


def test_an_upload_says_how_many_stored_samples_it_replaced(client, web_backend):
    first, other = (
        "time,FIC77.PV,FIC77.OP\n" + "".join(f"{at},{at % 7 + more},2\n" for at in range(1_750_000_000, 1_750_000_060))
        for more in (0, 1)
    )
    for data, added, replaced in ((first, 60, 0), (other, 0, 60)):
        number = client.post("/v1/uploads", content=data.encode()).json()["id"]
        read_upload(web_backend, int(number), "test")
        told = client.get(f"/v1/uploads/{number}").json()
        assert (told["samples_added"], told["samples_replaced"]) == (added, replaced)
    page = seen(client, f"/uploads/{number}").texts
    assert page[page.index("Stored samples replaced") + 1] == "60"
    assert any(text.startswith("60 stored samples were replaced by other values") for text in page)
    listed = client.get("/uploads").text
    for label in ("New samples", "Replaced"):
        assert f'<td class="number" data-label="{label}">60</td>' in listed
