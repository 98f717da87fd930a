"""Tags that tell no loop, and the mapping that `inspect` and `upload` take for them."""

import pytest

from app.main import create_app
from app.services.backend import Backend
from app.services.intake.reading import read_upload
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.cli.calling import as_program, run

STRANGE = "DateTime,TI-7,ZT-7\n" + "".join(f"2026-01-01T00:00:{k:02d}Z,{50 + k % 7},{40 + k % 5}\n" for k in range(60))
TAGS = "tag,loop,signal,unit,low,high\nTI-7,TIC7,PV,degC,0,250\nZT-7,TIC7,OP,%,0,100\n"


@pytest.fixture(autouse=True)
def no_service_is_about_to_start(monkeypatch) -> None:
    monkeypatch.setattr("app.cli.upload.START_S", 0.0)


@pytest.fixture
def strange(tmp_path):
    """An export whose tags tell no loop, and the mapping of its plant."""
    export, tags = tmp_path / "strange.csv", tmp_path / "tags.csv"
    export.write_text(STRANGE)
    tags.write_text(TAGS)
    return export, tags


def test_inspect_groups_tags_by_a_mapping(strange):
    export, tags = strange
    assert run("inspect", export).exit_code == 2
    done = run("inspect", export, "--mapping", tags)
    assert done.exit_code == 0, done.output
    assert "TIC7 PV OP 60" in " ".join(done.stdout.split())


def test_inspect_says_where_a_mapping_names_no_tag_of_the_file(strange):
    export, tags = strange
    tags.write_text("tag,loop,signal\nTI-8,TIC8,PV\n")
    text = " ".join(run("inspect", export, "--mapping", tags).stdout.split())
    assert "the mapping names none of the tags of this file; here is TI-7, ZT-7" in text


@pytest.mark.parametrize("command", ["inspect", "upload"])
@pytest.mark.parametrize(
    ("text", "code"),
    [
        (None, "no_such_file"),
        ("tag,loop,signal\n", "bad_mapping"),
        ("[{", "bad_mapping"),
        ('[{"tag": "TI-7", "loop": "TIC7", "signal": "PV", "signal": "OP"}]', "bad_mapping"),
        ("tag,loop,signal\nTI-7,TIC7,WHAT\n", "bad_mapping"),
    ],
)
def test_a_mapping_that_cannot_be_used_is_one_line(strange, monkeypatch, capsys, command, text, code):
    export, tags = strange
    tags.unlink() if text is None else tags.write_text(text)
    ended, out, err = as_program(monkeypatch, capsys, command, export, "--mapping", tags)
    assert (ended, out) == (2, "")
    assert f"[{code}]" in err
    assert err.count("\n") == 1


def test_an_upload_takes_its_mapping_along(strange, serve, tmp_path):
    export, tags = strange
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    with serve(create_app(settings)) as connection:
        url = str(connection.base_url)
        done = run("upload", export, "--mapping", tags, "--url", url)
        assert done.exit_code == 0, done.output
        upload_id = done.stdout.split("\t")[1]
        backend = Backend.open(settings)
        read_upload(backend, int(upload_id), owner="test")
        backend.close()
        assert connection.get(f"/v1/uploads/{upload_id}").json()["loops"] == ["TIC7"]
        loop = connection.get("/v1/loops/TIC7").json()
        assert (loop["pv_high"], loop["op_high"]) == (250.0, 100.0)
        assert run("upload", export, "--mapping", tags, "--url", url).stdout.split("\t")[1] == upload_id
