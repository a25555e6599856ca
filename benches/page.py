"""The page in a browser: milliseconds from an input to the paint, compared with a frame of an empty page."""

from __future__ import annotations

import gzip
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

HEAD = ("page", "measured", "goal")
DRIVE = 'drive = "catalogue:reference"\n'
ROUNDS, DRAG_MS, SAMPLES = 60, 3000, 4_000_000
#: Waits for an answer, told by a mark of the page, and for the frame that shows curves drawn since: an answer that is
#: there has not been drawn yet, and a frame may pass between the two.
PAINTED = """
  let cleared = 0;
  const clear = CanvasRenderingContext2D.prototype.clearRect;
  CanvasRenderingContext2D.prototype.clearRect = function (...place) {
    cleared = performance.now();
    clear.apply(this, place);
  };
  const painted = (mark) => new Promise((done) => {
    const seen = new MutationObserver(() => {
      seen.disconnect();
      const answered = performance.now();
      const look = () => (cleared >= answered ? setTimeout(done) : requestAnimationFrame(look));
      requestAnimationFrame(look);
    });
    seen.observe(document.documentElement, {attributes: true, attributeFilter: [mark]});
  });
"""
#: Moves a slider by a step, waits for its curves and the frame that shows them; ms of each round.
ONE_BY_ONE = (
    f"""async ([name, rounds]) => {{{PAINTED}"""
    """
  const slider = document.getElementById(name), out = [];
  for (let i = 0; i < rounds; i++) {
    await new Promise((done) => setTimeout(done, 7 + (i * 5) % 17));
    const began = performance.now(), drawn = painted("data-answered");
    slider.value = String(100 + (i * 7) % 40);
    slider.dispatchEvent(new Event("input", {bubbles: true}));
    await drawn;
    out.push(performance.now() - began);
  }
  CanvasRenderingContext2D.prototype.clearRect = clear;
  return out;
}"""
)
#: Moves a slider at each frame; ms between frames, and how many answers were drawn.
DRAGGED = """async ([name, lasts]) => {
  const page = document.documentElement, slider = document.getElementById(name), frames = [];
  const first = Number(page.dataset.drawn), began = performance.now();
  let last = began, i = 0;
  let drawn = 0;
  const seen = new MutationObserver(() => { drawn += 1; });
  seen.observe(page, {attributes: true, attributeFilter: ["data-drawn"]});
  while (performance.now() - began < lasts) {
    slider.value = String(100 + (i++ * 7) % 40);
    slider.dispatchEvent(new Event("input", {bubbles: true}));
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    frames.push(now - last);
    last = now;
  }
  return [frames, drawn / lasts * 1000];
}"""
EMPTY = """async (count) => {
  const frames = [];
  let last = await new Promise(requestAnimationFrame);
  for (let i = 0; i < count; i++) {
    const now = await new Promise(requestAnimationFrame);
    frames.push(now - last);
    last = now;
  }
  return frames;
}"""
#: Clicks a button of a recording, waits for its view and the frame that shows it; ms. Clicks fall anywhere in a frame.
VIEWS = (
    f"""async ([words, rounds]) => {{{PAINTED}"""
    """
  const out = [];
  for (let i = 0; i < rounds; i++) {
    const name = words[i % words.length];
    const button = [...document.querySelectorAll("button")].find((one) => one.textContent.trim().startsWith(name));
    await new Promise((done) => setTimeout(done, 60 + (i * 5) % 17));
    const drawn = painted("data-answered");
    const began = performance.now();
    button.click();
    await drawn;
    out.push(performance.now() - began);
  }
  CanvasRenderingContext2D.prototype.clearRect = clear;
  return out;
}"""
)

#: Plays the run of a platform to its end; samples drawn in a second.
PLAYED = """async () => {
  const platform = document.querySelector(".platform"), seen = new Set(), began = performance.now();
  [...document.querySelectorAll("button")].find((one) => one.textContent === "Play").click();
  while (platform.dataset.sample !== "399" && performance.now() - began < 9000) {
    await new Promise(requestAnimationFrame);
    seen.add(platform.dataset.sample);
  }
  return 1000 * seen.size / (performance.now() - began);
}"""


@contextmanager
def _browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    from page.conftest import chromium

    path = chromium()
    libraries = Path(path).parent / "al2023" / "lib"
    environment = {**os.environ, **({"LD_LIBRARY_PATH": str(libraries)} if libraries.is_dir() else {})}
    arguments = ["--headless=shell", "--no-sandbox", "--disable-gpu"]
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=path, args=arguments, env=environment)
        yield found
        found.close()


@contextmanager
def _driver_still() -> Iterator[None]:
    """Stop the driver between browser and script while a slider is dragged, on Linux only.

    Users of the page do not have this driver.

    The driver gets a copy of each answer and clears the copies on every processor for 15 ms at a time. This would delay
    frames.
    """
    children = [one for each in Path("/proc/self/task").glob("*/children") for one in each.read_text().split()]
    drivers = [int(one) for one in children if Path(f"/proc/{one}/exe").resolve().name == "node"]

    def tell(sign: int) -> None:
        for one in drivers:
            os.kill(one, sign)

    stop = threading.Timer(0.3, lambda: tell(signal.SIGSTOP))  # it has handed on what is to be run
    go_on = threading.Timer(DRAG_MS / 1e3 + 0.5, lambda: tell(signal.SIGCONT))
    for one in (stop, go_on):
        one.start()
    yield
    for one in (stop, go_on):
        one.join()


def _ms(values: list[float]) -> str:
    return f"{statistics.median(values):.1f} / {np.quantile(values, 0.95):.1f} ms"


def measure() -> list[tuple[str, str, str]]:
    """Return (what, measured, goal); goals are those of an idle machine."""
    with tempfile.TemporaryDirectory() as name, _browser() as browser:
        folder = Path(name)
        (folder / "axis.toml").write_text(DRIVE)
        (folder / "tripod.toml").write_text((ROOT / "examples" / "tripod.toml").read_text())
        _recording(folder / "rig.parquet")
        page = browser.new_page(locale="en-GB", viewport={"width": 1400, "height": 1000})
        empty = page.evaluate(EMPTY, ROUNDS)
        began = time.perf_counter()
        words = [sys.executable, "-m", "pneudrive", "web", str(folder), "--no-browser", "--port", "0"]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout
            address = process.stdout.readline().strip()
            rows = [("address printed", f"{time.perf_counter() - began:.2f} s", "0.5 s")]
            # From the command on: the address is printed before what serves it is imported.
            page.goto(address)
            page.click("text=axis.toml")
            page.wait_for_selector("[data-end=position_m]")
            rows.append(("command to first curves, with a click", f"{time.perf_counter() - began:.2f} s", "1 s"))
            rows.append(("a frame of an empty page, median / p95", _ms(empty), ""))
            return [*rows, *_rows(page), *_memory(process.pid)]
        finally:
            process.kill()
            process.communicate()


def _rows(page: Any) -> list[tuple[str, str, str]]:
    rows = []
    page.wait_for_timeout(1000)  # what the server imports behind the first curves
    began = time.perf_counter()
    page.reload()
    page.wait_for_selector("[data-end=position_m]")
    rows.append(("page reloaded, to its curves", f"{time.perf_counter() - began:.2f} s", "0.2 s"))
    slider = "slider-friction.coulomb"
    one = page.evaluate(ONE_BY_ONE, [slider, ROUNDS])
    rows.append(("slider: input to painted, median / p95", _ms(one), "20 / 25 ms"))
    with _driver_still():
        frames, answers = page.evaluate(DRAGGED, [slider, DRAG_MS])
    rows.append(("frames while dragging, p99", f"{np.quantile(frames, 0.99):.1f} ms", "18 ms"))
    rows.append(("answers a second while dragging", f"{answers:.0f}", "50"))
    page.check("text=band of 200 members")
    page.wait_for_selector("[data-band=position_m]")
    rows.append(("slider with a band of 200 members", _ms(page.evaluate(ONE_BY_ONE, [slider, 15])), "33 ms"))
    page.click(".tree >> text=Controllers")
    page.select_option("label:has-text('Law') select", "pid")
    page.wait_for_selector("[id='slider-gain']")
    for law, gain, goal in (("pid", "gain", "50 ms"), ("nmpc", "bandwidth", "300 ms")):
        page.select_option("label:has-text('Law') select", law)
        page.wait_for_selector(f"[id='slider-{gain}']")
        page.wait_for_timeout(1500)
        took = page.evaluate(ONE_BY_ONE, [f"slider-{gain}", 8])
        rows.append((f"gain of {law} along R3, 9.6 s at 1 kHz", _ms(took), goal))
    sizes: list[int] = []
    page.on("websocket", lambda one: one.on("framereceived", lambda sent: sizes.append(len(sent))))
    page.click(".home")
    page.click("text=rig.parquet")
    page.wait_for_selector("[data-points]")
    took = page.evaluate(VIEWS, [["Closer", "Later", "Earlier"], 24])
    rows.append((f"zoom or pan of {SAMPLES:.0e} samples to painted", _ms(took), "17 / 33 ms"))
    rows.append(("bytes of a view, largest", f"{max(sizes) / 1e3:.0f} kB", "64 kB"))
    page.evaluate("() => void (location.hash = '#/drive/tripod.toml')")
    page.click("button:text-is('Run in the drawing')")
    page.wait_for_selector(".turned svg")
    rows.append(("samples of a moving tripod drawn in a second", f"{page.evaluate(PLAYED):.0f}", "30"))
    rows.append(("first page, gzip", f"{_first_page() / 1e3:.0f} kB", "100 kB"))
    return rows


def _memory(pid: int) -> list[tuple[str, str, str]]:
    """Return the largest memory of the server and its reader process, on Linux only."""
    place = Path(f"/proc/{pid}/task/{pid}/children")
    if not place.is_file():
        return []
    each = (pid, *map(int, place.read_text().split()))
    found = [int(re.findall(r"VmHWM:\s+(\d+)", Path(f"/proc/{one}/status").read_text())[0]) / 1e3 for one in each]
    shown = " / ".join(f"{one:.0f}" for one in found)
    return [("memory of the server / its reader of files, largest", f"{shown} MB", "300 MB")]


def _recording(path: Path) -> None:
    import polars as pl

    rng = np.random.default_rng(1)
    time_s = np.arange(SAMPLES) * 1e-4
    values = {f"channel_{k}": np.sin(time_s * (k + 1)) + 0.1 * rng.standard_normal(SAMPLES) for k in range(3)}
    pl.DataFrame({"time_s": time_s, **values}).write_parquet(path, row_group_size=1 << 18)


def _first_page() -> int:
    built = ROOT / "python" / "pneudrive" / "web" / "built"
    index = (built / "index.html").read_text()
    files = [built / "index.html", *(built / name for name in re.findall(r'(?:src|href)="/(assets/[^"]+)"', index))]
    return sum(len(gzip.compress(path.read_bytes())) for path in files)


if __name__ == "__main__":
    from benches.tables import text

    print(text(HEAD, measure()))
