"""A correction of tags holds for later files, and a tag that is read otherwise than before is told."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy.exc import OperationalError

from app.errors import NotFoundError
from app.services.backend import Backend
from app.services.intake import places, uploads
from app.services.intake.uploads import ReadingOptions
from app.services.outward import UploadOut
from app.services.plant.trend import trend
from app.storage import tags
from tests.services.sent_uploads import read, send

SWAPPED = b"tag,loop,signal\nFIC900.PV,FIC900,OP\nFIC900.OP,FIC900,PV\n"
START = datetime(2026, 3, 1, tzinfo=UTC)


def hour(number: int, names: str = "FIC900.PV,FIC900.OP") -> bytes:
    """PV and OP of one hour in each other's columns: PV is about 100, OP about 40."""
    times = (START + timedelta(hours=number, minutes=minute) for minute in range(60))
    rows = (f"{at:%Y-%m-%d %H:%M:%S},{40 + at.minute % 3},{100 + at.minute % 7}" for at in times)
    return "\n".join([f"time,{names}", *rows, ""]).encode()


def sent(backend: Backend, number: int, name: str = "", mapping: bytes | None = None, **told: str) -> UploadOut:
    return read(backend, send(backend, hour(number, **told), name or f"{number}.csv", ReadingOptions(mapping=mapping)))


def corrected(backend: Backend, upload: UploadOut, mapping: bytes = SWAPPED, keep: bool = True) -> UploadOut:
    return read(backend, uploads.read_again(backend, upload.id, mapping, "somebody", keep).upload)


def smallest_pv(backend: Backend) -> float:
    return min(value for value in trend(backend, "FIC900").pv if value is not None)


def warned(upload: UploadOut) -> bool:
    return bool(upload.notes) and upload.notes[0].startswith("check this first")


def test_a_correction_holds_for_later_files_and_says_so(backend: Backend) -> None:
    corrected(backend, sent(backend, 0))
    later = sent(backend, 1)
    assert (later.tags[0]["pv"], later.tags[0]["op"]) == ("FIC900.OP", "FIC900.PV")
    assert len(later.notes) == 1
    assert "FIC900.PV as OP of FIC900" in later.notes[0]
    assert smallest_pv(backend) == 100.0


@pytest.mark.parametrize("breaks", ["receive", "try_again"])
def test_a_correction_whose_upload_could_not_be_registered_is_not_kept(
    backend: Backend, monkeypatch: pytest.MonkeyPatch, breaks: str
) -> None:
    """Whoever asked was told that it failed: tags of the next files must not be read otherwise all the same."""
    upload = sent(backend, 0)

    def away(*_: object) -> None:
        raise OperationalError("INSERT", {}, Exception("the server is away"))

    with monkeypatch.context() as broken:
        broken.setattr(uploads.uploads, breaks, away)
        with pytest.raises(OperationalError):
            uploads.read_again(backend, upload.id, SWAPPED, "somebody", keep=True)
    assert places.kept_by_loop(backend) == []
    assert sent(backend, 1).tags[0]["pv"] == "FIC900.PV"


def test_an_upload_whose_correction_cannot_be_kept_is_not_registered(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = sent(backend, 0)
    with monkeypatch.context() as broken:
        broken.setattr(tags, "keep", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            uploads.read_again(backend, upload.id, SWAPPED, "somebody", keep=True)
    assert [one.id for one in uploads.list_uploads(backend).rows] == [upload.id]


def test_a_correction_of_one_file_alone_is_no_later_ones_and_the_change_is_told(backend: Backend) -> None:
    again = corrected(backend, sent(backend, 0), keep=False)
    assert warned(again)
    later = sent(backend, 1)
    assert later.tags[0]["pv"] == "FIC900.PV"
    assert warned(later)
    assert "FIC900.PV is PV of FIC900 here and was OP of FIC900" in later.notes[0]
    assert not warned(sent(backend, 2))


def test_what_holds_for_later_files_can_be_taken_back(backend: Backend) -> None:
    corrected(backend, sent(backend, 0))
    ((first, second),) = places.kept_by_loop(backend)
    assert (first.tag, first.signal, first.kept_by, second.signal) == ("FIC900.OP", "PV", "somebody", "OP")
    places.forget(backend, "", "FIC900")
    assert places.kept_by_loop(backend) == []
    later = sent(backend, 1)
    assert later.tags[0]["pv"] == "FIC900.PV"
    assert warned(later)
    with pytest.raises(NotFoundError):
        places.forget(backend, "", "FIC900")


def test_a_files_own_mapping_goes_before_what_was_kept(backend: Backend) -> None:
    corrected(backend, sent(backend, 0))
    own = sent(backend, 1, mapping=b"tag,loop,signal\nFIC900.PV,FIC900,PV\n")
    assert (own.tags[0]["pv"], own.tags[0]["op"]) == ("FIC900.PV", "FIC900.OP")


def test_a_later_word_of_a_tag_takes_the_place_of_an_earlier_one(backend: Backend) -> None:
    first = sent(backend, 0)
    corrected(backend, first)
    corrected(backend, first, b"tag,loop,signal\nFIC900.PV,fic900,PV\n")
    ((only,),) = places.kept_by_loop(backend)
    assert (only.tag, only.signal) == ("FIC900.PV", "PV")
    assert sent(backend, 1).tags[0]["op"] == "FIC900.OP"


def test_what_is_said_of_a_bare_column_holds_for_files_of_that_name_alone(backend: Backend) -> None:
    first = sent(backend, 0, name="FIC900.csv", names="PV,OP")
    corrected(backend, first, b"tag,loop,signal\nPV,FIC900,OP\nOP,FIC900,PV\n")
    assert sent(backend, 1, name="fic900.csv", names="PV,OP").tags[0]["pv"] == "OP"
    other = sent(backend, 2, name="FIC901.csv", names="PV,OP")
    assert (other.tags[0]["loop"], other.tags[0]["pv"], other.notes) == ("FIC901", "PV", [])


def test_a_loop_in_other_letters_is_the_loop_that_is_there(backend: Backend) -> None:
    sent(backend, 0)
    later = sent(backend, 1, names="fic900.pv,Fic900.OP")
    assert (later.loops, later.notes) == (["FIC900"], [])
    assert len(trend(backend, "FIC900", 2000).pv) == 120


def test_a_signal_in_another_unit_is_told(backend: Backend) -> None:
    assert sent(backend, 0, names="TIC5.PV,TIC5.OP (%)").notes == []
    assert sent(backend, 1, names="TIC5.PV (degC),TIC5.OP (%)").notes == []
    assert sent(backend, 2, names="TIC5.PV,TIC5.OP").notes == []
    other = sent(backend, 3, names="TIC5.PV [degF],TIC5.OP (%)")
    assert warned(other)
    assert "PV of TIC5 is in degF here and was in degC" in other.notes[0]


def test_a_unit_once_known_stays_known(backend: Backend) -> None:
    """A file that tells none, and one in which the tag is another signal, do not make it forgotten."""
    sent(backend, 0, names="TIC5.PV (degC),TIC5.OP")
    moved = corrected(
        backend, sent(backend, 1, names="TIC5.PV,TIC5.OP"), SWAPPED.replace(b"FIC900", b"TIC5"), keep=False
    )
    assert "TIC5.PV is OP of TIC5 here and was PV" in moved.notes[0]
    other = sent(backend, 2, names="TIC5.PV (degF),TIC5.OP")
    assert any("PV of TIC5 is in degF here and was in degC" in note for note in other.notes)


def test_an_older_file_that_is_read_late_changes_nothing_of_what_newer_ones_say(backend: Backend) -> None:
    sent(backend, 0)
    late = send(backend, hour(1), "1.csv", ReadingOptions(mapping=SWAPPED))
    sent(backend, 2)
    key = places.key_of("FIC900.PV", "2.csv")
    with backend.database.read() as connection:
        known = tags.last_read(connection, [key])[key]
    assert (known.signal, known.receipt_number, known.newest_number) == ("PV", 1, 3)
    assert warned(read(backend, late))
    with backend.database.read() as connection:
        assert tags.last_read(connection, [key])[key] == known
    assert not warned(sent(backend, 3))


def test_an_older_file_that_is_read_late_tells_the_unit_that_no_newer_one_told(backend: Backend) -> None:
    sent(backend, 0, names="TIC5.PV,TIC5.OP")
    late = send(backend, hour(1, names="TIC5.PV (degC),TIC5.OP"), "1.csv")
    sent(backend, 2, names="TIC5.PV,TIC5.OP")
    read(backend, late)
    assert "PV of TIC5 is in degF here and was in degC" in sent(backend, 3, names="TIC5.PV (degF),TIC5.OP").notes[0]


def test_a_unit_in_a_row_of_units_that_changes_is_told(backend: Backend) -> None:
    sent(backend, 0, names="TIC5.PV,TIC5.OP\n,°C,%")
    assert "PV of TIC5 is in °F here and was in °C" in sent(backend, 1, names="TIC5.PV,TIC5.OP\n,°F,%").notes[0]
    assert "PV of TIC5 is in °C here and was in °F" in sent(backend, 2, names="TIC5.PV (°C),TIC5.OP").notes[0]


def test_columns_of_one_name_are_no_units(backend: Backend) -> None:
    assert not any("units" in note for number in (0, 1) for note in sent(backend, number, names="A.PV,A.PV").notes)


def test_a_tag_that_goes_to_another_loop_is_told(backend: Backend) -> None:
    sent(backend, 0, mapping=b"tag,loop,signal\nFIC900.PV,FIC-900,PV\nFIC900.OP,FIC-900,OP\n")
    assert "FIC900.PV is PV of FIC900 here and was PV of FIC-900" in sent(backend, 1).notes[0]


def test_a_correction_holds_for_files_that_tell_other_units(backend: Backend) -> None:
    first = sent(backend, 0, names="PIC5.PV (bar),PIC5.OP")
    corrected(backend, first, b"tag,loop,signal\nPIC5.PV (bar),PIC5,OP\nPIC5.OP,PIC5,PV\n")
    for number, names in enumerate(("PIC5.PV,PIC5.OP (%)", "PIC5.PV [psi],PIC5.OP", "PIC5.PV (bar),PIC5.OP"), 1):
        later = sent(backend, number, names=names)
        pv, op = names.split(",")
        assert (later.tags[0]["pv"], later.tags[0]["op"]) == (op, pv)


def test_tags_of_one_name_in_two_units_keep_their_own_places(backend: Backend) -> None:
    first = sent(backend, 0, names="FIC5 (m3/h),FIC5 (%)")
    corrected(backend, first, b"tag,loop,signal\nFIC5 (m3/h),FIC5,PV\nFIC5 (%),FIC5,OP\n")
    later = sent(backend, 1, names="FIC5 (%),FIC5 (m3/h)")
    assert (later.tags[0]["pv"], later.tags[0]["op"]) == ("FIC5 (m3/h)", "FIC5 (%)")


def test_a_loop_in_other_letters_is_taken_back_as_one(backend: Backend) -> None:
    corrected(backend, sent(backend, 0), SWAPPED.replace(b",FIC900,PV", b",Fic900,PV"))
    assert [len(rows) for rows in places.kept_by_loop(backend)] == [2]
    places.forget(backend, "", "FIC900")
    assert places.kept_by_loop(backend) == []


def test_what_was_exchanged_between_loops_is_taken_back_together(backend: Backend) -> None:
    mapping = b"tag,loop,signal\nFA1.PV,FA2,PV\nFA2.PV,FA1,PV\nX7,FA3,PV\n"
    corrected(backend, sent(backend, 0, names="FA1.PV,FA2.PV"), mapping)
    places.forget(backend, "", "FA1")
    assert [[row.tag for row in rows] for rows in places.kept_by_loop(backend)] == [["X7"]]


def test_a_correction_leaves_what_the_file_was_sent_with_of_other_tags(backend: Backend) -> None:
    sent_with = b"tag,loop,signal,unit\nT1,FIC900,PV,bar\nT2,FIC900,OP,\nT3,FIC900,SP,\n"
    first = sent(backend, 0, mapping=sent_with, names="T1,T2")
    again = corrected(backend, first, b"tag,loop,signal\nt1,FIC901,PV\n", keep=False)
    assert [(it["loop"], it["pv"], it["op"]) for it in again.tags] == [("FIC901", "T1", None), ("FIC900", None, "T2")]
    other = corrected(backend, again, b"tag,loop,signal\nT2,FIC901,PV\n", keep=False)
    assert [(it["loop"], it["pv"]) for it in other.tags if it["pv"]] == [("FIC901", "T2")]
