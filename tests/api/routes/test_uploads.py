"""Uploads: stored, told, refused."""

import gzip
import re
import zlib

import pytest

from app.services.intake.reading import read_upload
from tests.api.routes.exports import sent
from tests.swinging import wide


def test_an_upload_is_stored_and_says_where_to_ask(client):
    answer = client.post(
        "/v1/uploads?filename=a.csv", content=b"time,PV,OP\n0,1,2\n", headers={"Content-Type": "text/csv"}
    )
    assert answer.status_code == 202
    upload = answer.json()
    assert answer.headers["location"] == f"/v1/uploads/{upload['id']}"
    assert (upload["state"], upload["filename"], upload["size_bytes"]) == ("received", "a.csv", 17)
    assert client.get(answer.headers["location"]).json()["fingerprint"] == upload["fingerprint"]


def test_the_same_content_is_the_same_upload_raw_or_as_a_form(client):
    body = wide("FIC9")
    raw = sent(client, body, filename="x.csv")
    form = client.post("/v1/uploads", files={"file": ("x.csv", body, "text/csv")})
    assert form.status_code == 202
    assert form.json()["id"] == raw["id"]


def test_two_exports_without_any_name_are_two_loops(client, backend):
    bodies = ["".join(["time,PV,OP\n", *(f"{k},{k % 7},{k % b}\n" for k in range(50))]).encode() for b in (5, 9)]
    first, second, again = (
        client.post("/v1/uploads", content=body, headers={"Content-Type": "text/csv"}).json()
        for body in (*bodies, bodies[0])
    )
    assert first["id"] == again["id"] != second["id"]
    for upload in (first, second):
        read_upload(backend, int(upload["id"]), owner="test")
    found = [client.get(f"/v1/uploads/{upload['id']}").json() for upload in (first, second)]
    assert [one["loops"] for one in found] == [[f"upload-{one['fingerprint'][:12]}"] for one in found]
    assert found[0]["loops"] != found[1]["loops"]


@pytest.mark.parametrize("name", ["..", "%20", ".csv", "a/..", ".csv.gz"])
def test_a_name_that_names_nothing_is_none(client, name):
    sent_as = client.post(f"/v1/uploads?filename={name}", content=b"time,PV,OP\n0,1,2\n7,7,7\n").json()
    assert sent_as["filename"] == f"upload-{sent_as['fingerprint'][:12]}"


@pytest.mark.parametrize(
    ("told", "name"),
    [
        ('attachment; filename="FIC 7.csv"', "FIC 7.csv"),
        ("attachment; filename=FIC7.csv; size=3", "FIC7.csv"),
        ("attachment; filename=x.csv; filename*=UTF-8''T%C3%A4nk%207.csv", "Tänk 7.csv"),
        ('attachment; filename="Tänk 7.csv"', "Tänk 7.csv"),
        (r'attachment; FileName="a \"b\"\\c.csv"', "c.csv"),
        ("attachment", None),
        ("; filename*=UTF-8''%00%FF", "\ufffd"),
        ('attachment; filename="' + "x" * 300 + '"', "x" * 255),
    ],
)
def test_a_raw_body_has_the_name_of_its_header(client, told, name):
    headers = {"Content-Disposition": told.encode()}
    body = f"time,PV,OP\n0,1,{zlib.crc32(told.encode())}\n".encode()
    upload = client.post("/v1/uploads", content=body, headers=headers).json()
    assert upload["filename"] == (name or f"upload-{upload['fingerprint'][:12]}")
    asked = client.post("/v1/uploads?filename=own.csv", content=body + b"1,2,3\n", headers=headers).json()
    assert asked["filename"] == "own.csv"


def test_gzip_is_read(client, backend):
    upload = sent(client, gzip.compress(wide("FIC_Z")), filename="z.csv.gz")
    read_upload(backend, int(upload["id"]), owner="test")
    assert client.get(f"/v1/uploads/{upload['id']}").json()["loops"] == ["FIC_Z"]


def test_packed_in_any_way_it_is_the_same_upload(client):
    body = wide("FIC_Y")
    plain = sent(client, body, filename="y.csv")
    packed = [gzip.compress(body, mtime=at) for at in range(1, 4)]
    again = [
        client.post("/v1/uploads?filename=y.csv", content=packed[0], headers={"Content-Encoding": "gzip"}),
        client.post("/v1/uploads?filename=y.csv.gz", content=packed[1], headers={"Content-Type": "application/gzip"}),
        client.post("/v1/uploads", files={"file": ("y.csv.gz", packed[2], "application/gzip")}),
    ]
    assert {(answer.status_code, answer.json()["id"]) for answer in again} == {(202, plain["id"])}
    assert again[0].json()["fingerprint"] == plain["fingerprint"]


def test_the_list_of_uploads_counts_the_loops_and_leaves_naming_them_to_each(client, backend):
    body = re.sub(rb"(00:00:05Z),[^,]+", rb"\1,Bad Input", wide("FIC_L1", "FIC_L2"))
    upload = sent(client, body, filename="listed.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    listed = client.get("/v1/uploads?limit=1").json()["rows"][0]
    assert (listed["id"], listed["loops_found"], listed["rows_refused"]) == (upload["id"], 2, 1)
    assert not {"loops", "rejects", "tags"} & set(listed)
    assert listed["tags_found"] == 6
    one = client.get(f"/v1/uploads/{upload['id']}").json()
    assert {name: one[name] for name in listed} == listed
    assert (one["loops"], len(one["rejects"])) == (["FIC_L1", "FIC_L2"], 1)
    assert [loop["loop"] for loop in one["tags"]] == ["FIC_L1", "FIC_L2"]


@pytest.mark.parametrize("names", [["file", "file"], ["file", "file", "file"], ["file", "mapping", "mapping"]])
def test_no_part_of_a_form_is_dropped_without_a_word(client, names):
    before = client.get("/v1/uploads?limit=1").json()["rows"]
    parts = [(name, (f"{number}.csv", wide(f"FIC_P{number}"), "text/csv")) for number, name in enumerate(names)]
    answer = client.post("/v1/uploads", files=parts)
    assert (answer.status_code, answer.json()["code"]) == (400, "several_files")
    assert f"`{names[-1]}`" in answer.json()["detail"]
    assert client.get("/v1/uploads?limit=1").json()["rows"] == before


@pytest.mark.parametrize("second", ["Asia/Tokyo", ""])
def test_a_field_that_is_given_twice_is_refused_as_in_the_query(client, second):
    file = {"file": ("twice.csv", wide("FIC_T"), "text/csv")}
    answer = client.post("/v1/uploads", files=file, data={"time_zone": ["Europe/Berlin", second]})
    assert (answer.status_code, answer.json()["code"]) == (400, "several_files"), answer.text
    assert "`time_zone`" in answer.json()["detail"]


@pytest.mark.parametrize("names", [("time_zone", "date_order"), ("time_zone",), ("date_order",)])
def test_how_to_read_an_export_is_told_in_the_form_as_in_the_query(client, backend, names):
    body = b"time,PV,OP\n" + b"".join(b"03/04/2026 12:%02d:00,%d,%d\n" % (k, k % 7, k % 5) for k in range(60))
    told = {name: {"time_zone": "Asia/Kolkata", "date_order": "month"}[name] for name in names}
    file = {"file": (f"form-{'-'.join(names)}.csv", body, "text/csv")}
    answer = client.post("/v1/uploads", files=file, data=told)
    assert answer.json()["id"] == client.post("/v1/uploads", files=file, params=told).json()["id"]
    read_upload(backend, int(answer.json()["id"]), owner="test")
    date = "2026-03-04" if "date_order" in told else "2026-04-03"
    clock = "06:30:00" if "time_zone" in told else "12:00:00"
    assert client.get(answer.headers["location"]).json()["times_from"] == f"{date}T{clock}Z"


def test_what_the_query_says_counts_before_the_form(client):
    file = {"file": ("query-first.csv", wide("FIC_Q"), "text/csv")}
    both = client.post("/v1/uploads", files=file, data={"time_zone": "UTC"}, params={"time_zone": "Asia/Tokyo"})
    query = client.post("/v1/uploads", files=file, params={"time_zone": "Asia/Tokyo"})
    assert both.json()["id"] == query.json()["id"] != client.post("/v1/uploads", files=file).json()["id"]


def test_rows_that_cannot_be_read_are_told_with_line_and_reason(client, backend):
    body = re.sub(rb"(00:00:05Z),[^,]+", rb"\1,Bad Input", wide("FIC_R"))
    upload = sent(client, body, filename="r.csv")
    read_upload(backend, int(upload["id"]), owner="test")
    found = client.get(f"/v1/uploads/{upload['id']}").json()
    assert found["state"] == "done"
    assert found["rows_refused"] == 1
    assert found["rejects"][0]["line"] == 3
    assert "Bad Input" in found["rejects"][0]["text"]


@pytest.mark.parametrize(
    ("request_", "status", "code"),
    [
        ({"content": b""}, 400, "empty_upload"),
        ({"content": b"x" * 1_000_001}, 413, "upload_too_large"),
        ({"content": b"x" * 4_000_000}, 413, None),
        ({"content": iter([b"x" * 600_000] * 6)}, 413, None),
        ({"content": b"x", "headers": {"Content-Encoding": "br"}}, 415, "content_encoding"),
        ({"files": {"other": ("a.csv", b"x")}}, 400, "no_file"),
        ({"content": b"x", "headers": {"Content-Type": "multipart/form-data"}}, 400, None),
        ({"content": b"x", "headers": {"Content-Type": "multipart/form-data; boundary=x"}}, 400, None),
        ({"content": b"x", "params": {"time_zone": "Mars/Olympus"}}, 400, "unknown_time_zone"),
        ({"files": {"file": ("a.csv", b"x")}, "data": {"time_zone": "Mars/Olympus"}}, 400, "unknown_time_zone"),
        ({"files": {"file": ("a.csv", b"x")}, "data": {"time_zone": "x" * 61}}, 422, "invalid_request"),
        ({"files": {"file": ("a.csv", b"x")}, "data": {"date_order": "year"}}, 422, "invalid_request"),
        ({"content": b"x", "params": {"filename": "n" * 300}}, 422, "invalid_request"),
        ({"content": b"x", "params": {"date_order": "year"}}, 422, "invalid_request"),
    ],
)
def test_uploads_that_are_refused(client, request_, status, code):
    answer = client.post("/v1/uploads", **request_)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["code"] == (code or answer.json()["code"])


def test_nothing_is_left_of_a_refused_upload(client, backend):
    assert not list(backend.settings.uploads_dir.glob(".part-*"))
