"""A mail server that is given a time for the whole of a talk: `smtplib` gives one to each byte of its answers."""

import smtplib
import socket
import time
from contextlib import suppress
from threading import Timer
from types import TracebackType
from typing import Self


class TimedSMTP(smtplib.SMTP):
    """Its connection is cut after `whole_s` seconds: then what it is used for raises TimeoutError. What it said before,
    of the mail or of whom it is for, holds however it goes on and takes leave."""

    def __init__(self, host: str, port: int, timeout_s: float, whole_s: float) -> None:
        self._whole_s = whole_s
        self._ends_s = time.monotonic() + whole_s
        self._late = False
        self._line: socket.socket | None = None
        self._end = Timer(whole_s, self._cut)
        self._end.daemon = True
        self._end.start()
        try:
            super().__init__(host, port, timeout=timeout_s)
        except BaseException as error:
            self._leave()
            self._tell_late(self._late, error)
            raise

    def __enter__(self) -> Self:
        super().__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        late = self._late and not isinstance(error, smtplib.SMTPRecipientsRefused)  # cut as that was taken back
        try:
            with suppress(smtplib.SMTPException):  # of taking leave: a mail that was taken would be sent once more
                super().__exit__(kind, error, trace)
        finally:
            self._leave()
        self._tell_late(late, error)

    def _get_socket(self, host: str, port: int, timeout: float) -> socket.socket:
        made = self._connected(host, port, timeout)
        self._line = made.dup()  # encrypting takes the other one over, and it is to be cut amid that too
        if self._late:
            self._cut()
        return made

    def _connected(self, host: str, port: int, timeout: float) -> socket.socket:
        """To the first of its addresses that answers. Each may take that time, and a large provider has ten."""
        failed: OSError = TimeoutError("timed out")
        for *_, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            wait_s = min(timeout, self._ends_s - time.monotonic())
            if wait_s <= 0:
                break
            try:
                made: socket.socket = super()._get_socket(address[0], port, wait_s)  # type: ignore[misc]  # as SMTP_SSL
            except OSError as error:
                failed = error
            else:
                return made
        raise failed

    def _cut(self) -> None:
        self._late = True
        line = self._line
        if line is not None:
            with suppress(OSError):  # gone already
                line.shutdown(socket.SHUT_RDWR)

    def _tell_late(self, late: bool, error: BaseException | None) -> None:
        if late and isinstance(error, OSError):  # as all errors of smtplib are: half of an answer is taken for one
            raise TimeoutError(f"it did not take the mail within {self._whole_s:g} s") from error

    def _leave(self) -> None:
        self._end.cancel()
        self._end.join()
        if self._line is not None:
            self._line.close()
