"""The next piece of work while this one is used: reading a chunk of text leaves Python's lock free."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

Item = TypeVar("Item")
END: Any = object()


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """The same items in the same order, the next one made in a thread meanwhile; an error comes where it was raised."""
    with ThreadPoolExecutor(1, thread_name_prefix="reading-ahead") as thread:
        following = thread.submit(next, items, END)
        while (item := following.result()) is not END:
            following = thread.submit(next, items, END)
            yield item
