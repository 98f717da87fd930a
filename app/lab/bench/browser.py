"""How long pages take to open in Chromium, each time as for somebody who was never here: nothing is cached."""

import shutil

import numpy as np

from app.lab.bench.bench import Figures

NAMES = ("chromium", "chromium-browser", "google-chrome")
PAGES = {"plant page": "/", "table page": "/table"}
OPENED = 7
LONGEST_MS = 60_000
PAINTED = """() => new Promise((told) => new PerformanceObserver((seen) => {
  for (const one of seen.getEntries()) if (one.name === "first-contentful-paint") told(one.startTime);
}).observe({ type: "paint", buffered: true }))"""
NOW = "performance.now()"


def pages_open(url: str) -> Figures:
    """Milliseconds from the request to the first paint of the content, and to the load event; why not, where there is
    no Chromium or no playwright to drive it."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        return {"skipped": "no Chromium on this machine"}
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return {"skipped": "playwright is not installed"}
    with sync_playwright() as playwright:
        # In a container there is no sandbox to be had; the pages are our own.
        browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in PAGES}
        for _ in range(OPENED):
            for name, path in PAGES.items():
                page = browser.new_page(viewport={"width": 1280, "height": 900})
                page.goto(url + path, wait_until="load", timeout=LONGEST_MS)
                loaded = page.evaluate(NOW)
                times[name].append((page.evaluate(PAINTED), loaded))
                page.close()
        browser.close()
    return {name: _figures(np.array(some)) for name, some in times.items()}


def _figures(times: np.ndarray) -> Figures:
    """times: (opened, 2) first paint and load event, in ms."""
    middle, slowest = np.median(times, axis=0), times.max(axis=0)
    return {
        "painted_ms": float(middle[0]),
        "painted_max_ms": float(slowest[0]),
        "loaded_ms": float(middle[1]),
        "loaded_max_ms": float(slowest[1]),
    }
