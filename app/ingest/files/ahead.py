"""The next pieces of work while this one is used: reading and parting text leave Python's lock free."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")
END: Any = object()
SIDE_BY_SIDE = 2


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """The same items in the same order, the next one made in a thread meanwhile; an error comes where it was raised."""
    with ThreadPoolExecutor(1, thread_name_prefix="reading-ahead") as thread:
        following = thread.submit(next, items, END)
        while (item := following.result()) is not END:
            following = thread.submit(next, items, END)
            yield item


def side_by_side(make: Callable[[Item], Made], items: Iterator[Item]) -> Iterator[Made]:
    """What `make` makes of each item, in their order, two at a time; an error comes where it was raised."""
    with ThreadPoolExecutor(SIDE_BY_SIDE, thread_name_prefix="reading-side-by-side") as threads:
        waiting: deque[Future[Made]] = deque()
        for begun in _begun(threads, make, items):
            waiting.append(begun)
            if len(waiting) > SIDE_BY_SIDE:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _begun(threads: ThreadPoolExecutor, make: Callable[[Item], Made], items: Iterator[Item]) -> Iterator[Future[Made]]:
    """An error of the items themselves stands at its place too, behind what was begun before it."""
    try:
        for item in items:
            yield threads.submit(make, item)
    except Exception as error:  # noqa: BLE001 - it is raised where its result is taken
        failed: Future[Made] = Future()
        failed.set_exception(error)
        yield failed
