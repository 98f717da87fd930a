"""A client in a process of its own: asks for paths one after the other and says how long each answer took.

    python -m app.lab.bench.load HOST:PORT SECONDS KEY < paths

Plain http.client over one kept connection, so that little of what is measured is the client's own work.
"""

import http.client
import json
import sys
import time
from itertools import cycle


def ask(address: str, seconds: float, key: str, paths: list[str]) -> dict[str, object]:
    connection = http.client.HTTPConnection(address, timeout=60)
    headers = {"Authorization": f"Bearer {key}"} if key else {}
    times: list[float] = []
    wrong = size = 0
    until = time.monotonic() + seconds
    for path in cycle(paths):
        start = time.perf_counter()
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        body = answer.read()
        times.append(time.perf_counter() - start)
        wrong += answer.status != 200
        size = max(size, len(body))
        if time.monotonic() > until and len(times) >= 5:
            break
    return {"times_s": times, "wrong": wrong, "bytes": size}


if __name__ == "__main__":
    host, duration, secret = sys.argv[1:4]
    sys.stdout.write(json.dumps(ask(host, float(duration), secret, sys.stdin.read().split())))
