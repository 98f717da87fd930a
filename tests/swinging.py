"""A wide export of loops that swing, so that each can be audited."""

import csv
import io

UNREADABLE_ROWS = (7, 9)


def wide(*tags: str, samples: int = 400, unreadable: str | None = None) -> bytes:
    """PV, OP and SP of each loop, in 5 s. unreadable: what stands for PV in two of the rows, if anything."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(["DateTime", *(f"{tag}.{signal}" for tag in tags for signal in ("PV", "OP", "SP"))])
    for k in range(samples):
        minutes, seconds = divmod(k * 5, 60)
        swing = (k % 40) / 20 - 1
        pv = unreadable if unreadable and k in UNREADABLE_ROWS else 50 + swing**2 + k % 3 * 0.1
        stamp = f"2026-01-01T{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}Z"
        rows.writerow([stamp, *(value for _ in tags for value in (pv, 40 + 5 * swing, 50))])
    return text.getvalue().encode()
