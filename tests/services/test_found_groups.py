"""A process that ends does so with its search for groups, and with nothing begun after it."""

import threading

from app.services.found_groups import FoundGroups


def test_closing_waits_for_the_search_that_goes_on_and_calls_off_the_next():
    found, begun, going = FoundGroups(), threading.Event(), threading.Event()

    def slow() -> tuple[()]:
        begun.set()
        going.wait(60)
        return ()

    first = found.of(("a state",), slow)
    assert begun.wait(60)
    second = found.of(("another",), slow)
    threading.Timer(0.2, going.set).start()
    found.close()
    assert first.result(0) == ()
    assert second.cancelled()
