"""The errors a user can cause, as one class tree with stable codes.

Bad data is the user's: it gets a `DataError` or a `RequestError` with a code that scripts may rely on and a message
that says what was got and what is needed, and it is never retried. A fault of ours is any other exception: logged,
retried, shown.
"""


class LoopauditError(Exception):
    """Something a user can mend. `code` is stable; `message` says what was got and what is needed."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.code, self.message)


class DataError(LoopauditError):
    """A recording, an export or a simulation that cannot be used."""


class RequestError(LoopauditError):
    """A request that cannot be served as it was made (unknown parameter, wrong state)."""


class FieldError(RequestError):
    """One field of a form, or of a row, cannot be taken as it is; `field` is its name."""

    def __init__(self, code: str, message: str, field: str) -> None:
        super().__init__(code, message)
        self.field = field

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return type(self), (self.code, self.message, self.field)


class NotFoundError(RequestError):
    """What was asked for is not there."""


def in_our_words(message: str) -> str:
    """A sentence of ours that pydantic hands on, without what it puts before it."""
    return message.removeprefix("Value error, ")
