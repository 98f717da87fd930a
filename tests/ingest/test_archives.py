"""Zip archives, as file managers pack what is sent: told as what they are."""

import gzip
import io
import struct
import zipfile
from collections.abc import Callable

import pytest

from app.errors import DataError

from .conftest import Read
from .test_bad_input import GOOD, HEADER


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_a_zip_archive_is_to_be_unpacked(read: Read, method: int, pack: Callable[[bytes], bytes]) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr("night.csv", HEADER + GOOD * 50)
    with pytest.raises(DataError, match="this is a zip archive") as error:
        read(pack(packed.getvalue()), name="night.zip")
    assert error.value.code == "not_an_export"


def test_a_workbook_of_the_old_form_is_to_be_saved_anew(read: Read) -> None:
    with pytest.raises(DataError, match=r"old form \(\.xls\): save it as \.xlsx or CSV") as error:
        read(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(range(256)) * 8, name="night.xls")
    assert error.value.code == "not_an_export"


def dbase(kind: bytes = b"\x03") -> bytes:
    names = (("Date", "C", 10), ("Time", "C", 8), ("Millitm", "N", 3), ("0", "N", 10), ("1", "N", 10))
    columns = b"".join(struct.pack("<11sc4xB15x", name.encode(), of.encode(), width) for name, of, width in names)
    head = kind + struct.pack("<BBBLHH20x", 123, 3, 23, 60, 33 + len(columns), 42) + columns + b"\r"
    return head + b"".join(b" 2023-03-2318:45:%02d  8%10d%10d" % (k, k % 9, k % 7) for k in range(60)) + b"\x1a"


@pytest.mark.parametrize("kind", [b"\x03", b"\x30"])
def test_a_dbase_table_is_to_be_saved_as_text(read: Read, kind: bytes) -> None:
    with pytest.raises(DataError, match=r"dBase table \(\.dbf\).* save it as CSV with the names of the tags") as error:
        read(dbase(kind), name="snapshot.dbf")
    assert error.value.code == "not_an_export"
