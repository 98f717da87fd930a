"""Files in encodings of two and four bytes a letter: read by their mark, and empty where they are blank."""

import pytest

from app.errors import DataError
from tests.ingest.conftest import Read

TABLE = "time,A.PV,A.OP\n" + "".join(f"2024-03-01 00:0{k}:00,{k},{10 * k}\n" for k in range(4))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("text", ["", " ", "\n\n", " \r\n" * 40])
def test_a_blank_file_is_empty_in_any_encoding(read: Read, encoding: str, text: str) -> None:
    with pytest.raises(DataError) as refused:
        read(text.encode(encoding))
    assert refused.value.code == "empty_file"


@pytest.mark.parametrize("order", ["little", "big"])
def test_utf_32_with_its_mark_is_read(read: Read, order: str) -> None:
    text = "\ufeff" + TABLE.replace("\n", "\r\n")
    content = read(text.encode("utf-32-le" if order == "little" else "utf-32-be"))
    assert content.summary.encoding == "utf-32"
    assert content.loops["A"].samples == 4
    assert not content.rejects.counts
