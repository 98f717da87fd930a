"""What pages say of loops that oscillate together."""

from dataclasses import replace

import pytest
from sqlalchemy import select, update

from app.engine.codes import UNANSWERED
from app.main import create_app
from app.services.plant import groups, loop_sheet, loop_verdicts
from app.services.plant.groups import plant_groups
from app.services.telling.next_steps import LONGER, Ask
from app.storage.tables import loops, newest_rows
from app.web import loop as loop_page
from tests.told_groups import group_of
from tests.web.conftest import HOSTILE, seen


def test_groups_are_listed_for_machines(client):
    told = client.get("/v1/groups").json()
    assert told["next_cursor"] is None
    tags = {member["loop"] for group in told["rows"] for member in group["members"]}
    assert tags <= {"FIC101", "LIC7", HOSTILE}
    assert len(tags) == 3  # the three carry one and the same swing


def test_no_source_is_named_of_loops_that_may_share_a_period_by_chance(client, web_backend, monkeypatch):
    crowded = group_of("1", 300.0, True, True, 0.84, None, plant_groups(web_backend)[0].members)
    monkeypatch.setattr(groups, "soon", lambda backend: (crowded,))
    told = " ".join(seen(client, "/groups").texts)
    assert "No loops were found of which one is likely to disturb the others." in told
    assert "1 group that shares its period probably by chance" in told
    assert "Probability of chance 0.84." in told
    assert "Likeliest source:" not in told
    assert "Probably no member sticks" not in told


def test_a_group_that_something_shakes_stands_before_those_of_chance(client, web_backend, monkeypatch):
    members = plant_groups(web_backend)[0].members
    shaken = group_of("1", 300.0, True, False, 0.001, "LIC7", members)
    crowded = group_of("2", 500.0, False, True, 0.9, None, members)
    monkeypatch.setattr(groups, "soon", lambda backend: (shaken, crowded))
    html = client.get("/groups").text
    before, by_chance = html.split('<details id="by-chance">')
    assert 'id="group-1"' in before
    assert 'id="group-2"' in by_chance
    assert "they do not move in step: that would need 0.70" in by_chance
    assert "they do not move in step" not in before


@pytest.mark.parametrize(
    ("moves", "said"), [(True, "their set points move together"), (False, "look outside these loops")]
)
def test_of_healthy_loops_the_set_points_are_asked_first(client, web_backend, monkeypatch, moves, said):
    members = plant_groups(web_backend)[0].members
    healthy = group_of("1", 300.0, True, False, 0.001, None, members, moves)
    monkeypatch.setattr(groups, "soon", lambda backend: (healthy,))
    told = client.get("/groups").text
    assert said in told
    assert ("look outside" in told) is not moves


def test_of_valves_that_stick_each_by_itself_none_is_said_to_shake_the_others(client, web_backend, monkeypatch):
    members = [replace(member, stiction_probability=0.99) for member in plant_groups(web_backend)[0].members]
    several = group_of("1", 300.0, True, False, 0.001, None, members)
    monkeypatch.setattr(groups, "soon", lambda backend: (several,))
    told = client.get("/groups").text
    assert "Some members stick, but none explains what the others share" in told
    assert "Probably no member sticks" not in told


def test_a_loop_that_shares_its_period_by_chance_is_not_said_to_swing_with_others(client, web_backend, monkeypatch):
    crowded = group_of("1", 300.0, True, True, 0.84, None, plant_groups(web_backend)[0].members)
    monkeypatch.setattr(loop_sheet, "groups_of", lambda found, tag: [crowded])
    told = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    assert "Its period is shared by 2 other loops , probably by chance." in told
    assert "oscillates together" not in told


@pytest.mark.parametrize(
    ("by_chance", "said"), [(False, "look there first."), (True, "look there first; it may be chance.")]
)
def test_a_loop_names_the_source_of_its_group_also_where_that_may_be_chance(
    client, web_backend, monkeypatch, by_chance, said
):
    members = plant_groups(web_backend)[0].members
    pair = group_of("1", 300.0, True, by_chance, 0.03, "LIC7", members)
    monkeypatch.setattr(loop_sheet, "groups_of", lambda found, tag: [pair])
    told = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    assert f"the likeliest source is LIC7 : {said}" in told


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (Ask.SHAKEN, "Then: Once its valve is repaired, this one may stop oscillating by itself. If it goes on,"),
        (Ask.MAY_BE_SHAKEN, "Then: Where operation allows it, put the loop in manual for a few cycles:"),
        (f"{Ask.SHAKEN_FROM_OUTSIDE} {LONGER}.", f"Then: Leave the valve alone. {LONGER}."),
        (Ask.MAY_STICK, f"Then: {Ask.MAY_STICK}"),
    ],
)
def test_a_loop_is_sent_to_the_source_once(client, web_backend, monkeypatch, step, said):
    _shaken_by_lic7(web_backend, monkeypatch, step)
    page = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    report = " ".join(" ".join(seen(client, "/v1/loops/FIC101/report").texts).split())
    for told in (page.replace("LIC7 ,", "LIC7,"), report):
        assert f"First look at LIC7, with which it oscillates in step. {said}" in told
        assert "Look first" not in told


@pytest.mark.parametrize("step", ["Wait: shelved until 3 May 2027.", Ask.LOOK_TODAY, Ask.NOTHING_NEWER])
def test_what_waits_or_is_urgent_does_not_come_behind_the_source(client, web_backend, monkeypatch, step):
    _shaken_by_lic7(web_backend, monkeypatch, step)
    told = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    assert f"What to do: {step}" in told
    assert "First look at" not in told


def _shaken_by_lic7(web_backend, monkeypatch, step):
    health = loop_verdicts.loop_health
    pair = group_of("1", 300.0, True, False, 0.001, "LIC7", plant_groups(web_backend)[0].members)
    monkeypatch.setattr(loop_sheet, "groups_of", lambda found, tag: [pair])
    monkeypatch.setattr(loop_verdicts, "loop_health", lambda *asked: health(*asked) | {"next_step": str(step)})


def test_a_loop_is_sent_to_no_source_of_loops_that_are_not_in_step(client, web_backend, monkeypatch):
    members = plant_groups(web_backend)[0].members
    alike = group_of("1", 300.0, False, True, 0.03, "LIC7", members)
    monkeypatch.setattr(loop_sheet, "groups_of", lambda found, tag: [alike])
    monkeypatch.setattr(loop_page, "_beside", lambda *_: (None, None))
    told = " ".join(" ".join(seen(client, "/loops/FIC101").texts).split())
    assert "oscillates together with" in told
    assert "LIC7" not in told


def test_groups_that_are_not_shown_are_counted_and_links_to_them_lead_there(client, web_backend, monkeypatch):
    members = plant_groups(web_backend)[0].members
    shaken = [group_of(str(k), 300.0, True, False, 0.001, "LIC7", members) for k in range(1, 104)]
    crowded = [group_of(str(k), 300.0, True, True, 0.84, None, members) for k in range(104, 206)]
    monkeypatch.setattr(groups, "soon", lambda backend: (*shaken, *crowded))
    found = client.get("/groups").text
    assert '3 more: <a href="/v1/groups">' in found
    assert '2 more: <a href="/v1/groups">' in found
    assert all(f'id="group-{number}"' in found for number in (1, 103, 104, 205))


def test_a_prior_is_no_probability_that_was_measured(client, web_backend, monkeypatch):
    first, *others = plant_groups(web_backend)[0].members
    members = [replace(first, stiction_probability=0.6, measured=False), *others]
    monkeypatch.setattr(
        groups,
        "soon",
        lambda backend: (group_of("1", 300.0, True, False, 0.001, None, members),),
    )
    html = client.get("/groups").text
    assert '<td class="number">–</td>' in html[: html.index(others[0].loop[:6])]


def test_loops_that_do_not_answer_have_a_prior(web_backend):
    said = select(newest_rows.c.verdict, newest_rows.c.likely_cause).where(newest_rows.c.loop_id == 1)
    now = update(newest_rows).where(newest_rows.c.loop_id == 1)
    with web_backend.database.write() as connection:
        before = connection.execute(said).one()._asdict()
        tag = connection.scalar(select(loops.c.tag).where(loops.c.id == 1))
        connection.execute(now.values(verdict="inconclusive", likely_cause=UNANSWERED))
    try:
        (group,) = groups._worked_out(web_backend)
        assert [member.loop for member in group.members if not member.measured] == [tag]
    finally:
        with web_backend.database.write() as connection:
            connection.execute(now.values(**before))


def test_a_plant_that_was_never_audited_is_not_said_to_have_no_groups(serve, open_plant):
    with serve(create_app(open_plant().settings)) as empty:
        told = empty.get("/groups").text
    assert "No loop in service has been audited yet." in told
    assert "No two loops were found" not in told


def test_an_audited_plant_without_groups_is_told_so(client, monkeypatch):
    monkeypatch.setattr(groups, "soon", lambda backend: ())
    assert "No two loops were found to oscillate together." in client.get("/groups").text


def test_of_a_group_of_hundreds_the_first_are_seen_and_the_others_open(client, web_backend, monkeypatch):
    members = plant_groups(web_backend)[0].members
    for count, folded in ((20, 0), (334, 314)):
        shaken = group_of("1", 300.0, True, False, 0.001, "LIC7", (list(members) * count)[:count])
        monkeypatch.setattr(groups, "soon", lambda backend, shaken=shaken: (shaken,))
        seen_first, _, others = client.get("/groups").text.partition("<details>")
        assert seen_first.count('<td class="tag">') == 20
        assert others.count('<td class="tag">') == folded
    assert "<summary>314 more</summary>" in others
