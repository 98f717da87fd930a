"""Results of queries to the databases of control systems, by the names that their columns have there."""

import numpy as np
import pytest

from .conftest import Read

ROWS = 60


def table(heading: str, row: str) -> str:
    """Of a tag a row: {tag}, {number} of it, {t}, {v} and {bad}, which is 1 in every tenth row of PV."""
    lines = [
        row.format(
            tag=f"Plant.FIC1.{tag}",
            number=number,
            t=f"2024-01-31 06:00:{k:02d}.000",
            v=k % 9,
            bad=k % 10 == 3 and tag == "PV",
        )
        for k in range(ROWS)
        for number, tag in ((21, "PV"), (22, "OP"))
    ]
    return "\n".join((heading, *lines)) + "\n"


def test_geo_scada_names_a_point_in_full(read: Read) -> None:
    heading = "Id,FullName,RecordTime,ValueAsReal,FormattedValue,StateDesc,QualityDesc,Reason"
    text = table(heading, "{number},{tag},{t},{v},{v} m3/h,,{bad},Value Change")
    content = read(text.replace("False,Value", "Good,Value").replace("True,Value", "Bad,Value"))
    assert content.loops.keys() == {"Plant.FIC1"}
    assert content.rejects.counts == {"bad_quality": 6}
    pv = content.loops["Plant.FIC1"].pv
    assert pv is not None
    assert np.flatnonzero(np.isnan(pv)).tolist() == list(range(3, ROWS, 10))


def test_wincc_tells_tags_by_the_number_of_the_value(read: Read) -> None:
    text = table("ValueID,Timestamp,RealValue,Quality,Flags", "{number},{t},{v},{bad},8392704")
    content = read(text.replace(",False,", ",128,").replace(",True,", ",0,"))
    assert content.loops.keys() == {"21", "22"}
    assert content.rejects.counts == {"bad_quality": 6}


@pytest.mark.parametrize("code", [300, 301, 310, 330, 340, 403, 404, 405, 410, 500, 600, 900, 901, 516, 770])
def test_ignition_says_why_a_value_is_bad(read: Read, code: int) -> None:
    text = table("tagpath,floatvalue,dataintegrity,t_stamp", "{tag},{v},{bad},{t}")
    content = read(text.replace(",False,", ",192,").replace(",True,", f",{code},"))
    assert content.rejects.counts == {"bad_quality": 6}


@pytest.mark.parametrize("code", [192, 200, 216, 700])
def test_ignition_says_that_a_value_is_good(read: Read, code: int) -> None:
    text = table("tagpath,floatvalue,dataintegrity,t_stamp", "{tag},{v},{bad},{t}")
    assert read(text.replace(",False,", ",192,").replace(",True,", f",{code},")).rejects.total == 0


@pytest.mark.parametrize("code", [340, 410, 500])
def test_ignition_says_so_where_a_whole_tag_is_bad(read: Read, code: int) -> None:
    text = table("tagpath,floatvalue,dataintegrity,t_stamp", f"{{tag}},{{v}},{code},{{t}}")
    assert read(text).rejects.counts == {"bad_quality": 2 * ROWS}


@pytest.mark.parametrize("heading", ["Name,FullName,Time,Value", "FullName,Name,Time,Value"])
def test_a_full_name_goes_before_a_name_that_several_points_have(read: Read, heading: str) -> None:
    names = {"Name": "{tag}", "FullName": "Plant.{loop}.{tag}"}
    order = heading.split(",")[:2]
    rows = (
        ",".join(names[name].format(loop=loop, tag=tag) for name in order) + f",2024-01-31 06:00:{k:02d},{k % 9}"
        for k in range(ROWS)
        for loop in ("FIC1", "FIC2")
        for tag in ("PV", "OP")
    )
    content = read("\n".join((heading, *rows)))
    assert content.loops.keys() == {"Plant.FIC1", "Plant.FIC2"}


@pytest.mark.parametrize("other", ["FullName", "ValueID"])
@pytest.mark.parametrize("cell", ["feed of unit 3", "{k}", "Plant.{tag}"])
@pytest.mark.parametrize("tag", ["FIC1.PV", "Boiler A"])
def test_names_of_tags_stay_so_beside_it(read: Read, other: str, cell: str, tag: str) -> None:
    rows = (f"{cell.format(k=k, tag=tag)},{tag},2024-01-31 06:00:{k:02d},{k % 9}" for k in range(ROWS))
    content = read("\n".join((f"{other},TagName,Time,Value", *rows)))
    assert {tag for loop in content.summary.loops for tag in (loop.pv, *loop.others) if tag} == {tag}
