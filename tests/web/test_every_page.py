"""What holds of every page: what a plant sends stays text, and nothing runs that is not ours."""

import pytest
from numba.core import event

from app import kernel_cache
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


def test_while_the_engine_is_compiled_pages_say_what_waits_for_it(client, tmp_path, monkeypatch):
    """It may be another plant's process, and then nothing here waits."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    with kernel_cache.one_at_a_time(), event.trigger_event("numba:compile"):
        page = client.get("/table").text
    assert "A process of the account that runs this service compiles the engine" in page
    assert "a worker that is ready waits for nothing" in page
    assert 'id="compiling"' not in client.get("/table").text
