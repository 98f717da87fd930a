"""Writes the table of a run into its page, between two marks."""

import os
from datetime import UTC, datetime
from pathlib import Path

from tests.chaos.judging import Judgement, Row

BEGIN, END = "<!-- chaos: begin -->", "<!-- chaos: end -->"


def page_table(rows: list[Row], found: Judgement, seed: int, took_s: float) -> str:
    head = [
        f"`make chaos SEED={seed}` on {datetime.now(UTC):%Y-%m-%d}: {sum(row.times for row in rows)} faults of "
        f"{len(rows)} kinds in {took_s / 60:.1f} min, {os.cpu_count()} cores.",
        f"Asserted: {found.asserted:,} loop audits in {found.runs} runs ({found.verdicts:,} verdicts, "
        f"{sum(found.failures.values())} stated failures: {stated(found)}), {found.uploads} acknowledged uploads with "
        f"{found.samples:,} samples.",
        "",
        "| fault | times | lost | duplicated | unfinished | recovered after, median s | longest s |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    lines = [
        f"| {row.fault} | {row.times} | {row.lost} | {row.duplicated} | {row.unfinished} "
        f"| {row.median_s:.1f} | {row.longest_s:.1f} |"
        for row in rows
    ]
    return "\n".join([*head, *lines])


def stated(found: Judgement) -> str:
    return ", ".join(f"{count} {code}" for code, count in found.failures.most_common()) or "none"


def refresh(page: Path, text: str) -> None:
    before, rest = page.read_text(encoding="utf-8").split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
