"""What holds of every page: what a plant sends stays text, and nothing runs that is not ours."""

import pytest

from tests.web.conftest import HOSTILE, PAGES, seen


@pytest.mark.parametrize("path", PAGES)
def test_a_page_brings_no_script_and_no_style_but_our_own(client, path):
    found = seen(client, path)
    assert found.forbidden == []
    assert all(source and source.startswith("/static/") for source in found.scripts)


@pytest.mark.parametrize("path", ["/", "/table", "/uploads/1"])
def test_hostile_names_stay_text(client, path):
    assert any(HOSTILE in text for text in seen(client, path).texts)


def test_the_glossary_defines_every_figure_of_a_loop(client):
    texts = seen(client, "/glossary").texts
    for field in ("health", "harris_index", "service_factor_pct", "response_time_s", "yper_pct"):
        assert field in texts


@pytest.mark.parametrize("path", ["/loops/nothing", "/runs/99", "/uploads/99", "/loops/nothing/charts"])
def test_what_is_not_there_is_not_found(client, path):
    assert client.get(path).status_code == 404
