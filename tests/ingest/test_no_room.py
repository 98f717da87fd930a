"""Where the parts of a large file do not fit on the disk it is told how much of it had been read."""

import errno
import io

import polars
import pytest

from app.ingest import IngestOptions, NoRoomToPartError, read_export
from app.ingest.tables import spilling

from .test_tables import workbook

SMALL = IngestOptions(chunk_bytes=1 << 12, buffered_values=200)


class Full(io.BytesIO):
    """A file that takes nothing, and cannot be closed for that."""

    def write(self, _: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        super().close()
        raise OSError(errno.ENOSPC, "No space left on device")


def export(rows: int) -> bytes:
    lines = (f"2026-01-01T00:{k // 60:02d}:{k % 60:02d}Z,{k % 7},{k % 5}\n" for k in range(rows))
    return "".join(["time,FIC1.PV,FIC1.OP\n", *lines]).encode()


def test_a_full_disk_tells_what_had_found_room(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_bytes(export(3000))
    opened = read_export(path, options=SMALL)
    monkeypatch.setattr(spilling.tempfile, "TemporaryFile", lambda **_: Full())
    with pytest.raises(NoRoomToPartError, match="No space") as refused:
        list(opened.loops())
    assert (refused.value.errno, refused.value.parted_bytes) == (errno.ENOSPC, 0)
    assert 0.0 < opened.share_taken < 1.0


def test_of_a_file_that_was_read_all_is_taken(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(export(3000))
    opened = read_export(path, options=SMALL)
    list(opened.loops())
    assert opened.share_taken == 1.0


@pytest.mark.parametrize("kind", ["parquet", "xlsx"])
def test_a_table_of_another_kind_does_not_tell(tmp_path, kind):
    rows = [line.split(",") for line in export(20).decode().splitlines()]
    path = tmp_path / f"a.{kind}"
    if kind == "parquet":
        polars.DataFrame(rows[1:], schema=rows[0], orient="row").write_parquet(path)
    else:
        pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
        path.write_bytes(workbook(rows))
    assert read_export(path).share_taken == 1.0
