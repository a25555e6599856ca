"""A campaign-sized friction map: 500 speeds x 15 pressures x 2 directions x 5000 samples.

    python -m benches.campaign_map [--speeds 500] [--pressures 15] [--folder DIR] [--keep]

Makes a campaign file of 75 million samples (Stribeck friction, sensor noise and quantisation, seeded), then
characterises it in a fresh process. It prints wall time, memory and the errors of the result. The bar is 20 s and 4 GiB
on 2 processors. Making the file is not part of the time.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SAMPLES_PER_STROKE = 5000
STROKE_M = 0.4
BORE_M = 0.032
AMBIENT_PA = 101325.0
SPEEDS_M_S = (1e-3, 450e-3)
GAUGE_PA = (0.1e5, 1.5e5)
BAR_SECONDS, BAR_GIB = 20.0, 4.0

LAYOUT = f"""
format = "parquet"

[columns]
cycle = {{ column = "cycle" }}
time = {{ column = "time_s", unit = "s" }}
position = {{ column = "position_m", unit = "m" }}
force = {{ column = "force_n", unit = "N", positive = "+x" }}
pressure_a = {{ column = "pressure_a_pa", unit = "Pa abs" }}
pressure_b = {{ column = "pressure_b_pa", unit = "Pa abs" }}

[geometry]
kind = "rodless"
bore = "{BORE_M * 1e3:g} mm"
"""

MEASURED = """
import json, resource, sys, threading, time
from pathlib import Path

def memory_gib(stop, seen):
    import os
    page = os.sysconf("SC_PAGE_SIZE") / 2**30
    while not stop.wait(0.05):
        own = os.getpid()
        kept = 0.0
        for status in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = status.read_text().rsplit(")", 1)[1].split()
                if int(status.parent.name) == own or int(fields[1]) == own:
                    kept += int(fields[21]) * page
            except (OSError, IndexError):
                continue
        seen[0] = max(seen[0], kept)

stop, seen = threading.Event(), [0.0]
watch = threading.Thread(target=memory_gib, args=(stop, seen))
watch.start()
start = time.perf_counter()
import pneudrive as pn
from pneudrive.characterise import write_map
curves = pn.characterise(sys.argv[1], layout=sys.argv[2])
write_map(curves, sys.argv[3])
seconds = time.perf_counter() - start
stop.set()
watch.join()
print(json.dumps({"seconds": seconds, "gib": seen[0], "rows": curves.sizes["row"]}))
"""


def friction_n(speed_m_s: np.ndarray | float, gauge_pa: float) -> np.ndarray | float:
    """Truth of the generated campaign: Stribeck with a level that rises with pressure, N."""
    coulomb = 20.0 + 2e-5 * gauge_pa
    return coulomb * (1.0 + 0.5 * np.exp(-((speed_m_s / 0.02) ** 2))) + 40.0 * speed_m_s


def make_campaign(path: Path, speeds: int, pressures: int, seed: int = 1) -> int:
    """Write a campaign file; return its number of samples."""
    import polars as pl

    rng = np.random.default_rng(seed)
    per_cycle = 2 * SAMPLES_PER_STROKE
    count = speeds * pressures
    forth = (np.arange(SAMPLES_PER_STROKE) + 0.5) / SAMPLES_PER_STROKE * STROKE_M
    position = np.concatenate([forth, forth[::-1]]).astype(np.float32)
    direction = np.repeat([1.0, -1.0], SAMPLES_PER_STROKE).astype(np.float32)
    travelled = np.where(direction > 0, position, STROKE_M - position)
    rise = (1.0 - 2.0 * np.exp(-travelled / 5e-4)).astype(np.float32)  # presliding after each reversal
    columns = {name: np.empty(count * per_cycle, np.float32) for name in ("time_s", "position_m", "force_n")}
    cycle = 0
    for gauge in np.linspace(*GAUGE_PA, pressures):
        for speed in np.linspace(*SPEEDS_M_S, speeds):
            part = slice(cycle * per_cycle, (cycle + 1) * per_cycle)
            columns["time_s"][part] = np.arange(per_cycle) * (STROKE_M / speed / SAMPLES_PER_STROKE)
            columns["position_m"][part] = position
            noise = rng.standard_normal(per_cycle, dtype=np.float32) * np.float32(0.3)
            force = direction * rise * np.float32(friction_n(speed, gauge)) + noise
            columns["force_n"][part] = np.round(force / 0.01) * 0.01
            cycle += 1
    frame = pl.DataFrame(columns).with_columns(
        pl.Series("cycle", np.repeat(np.arange(count, dtype=np.int32), per_cycle)),
        *(
            pl.Series(
                f"pressure_{side}_pa",
                np.repeat(np.linspace(*GAUGE_PA, pressures).astype(np.float32) + AMBIENT_PA, speeds * per_cycle)
                + np.round(rng.standard_normal(count * per_cycle, dtype=np.float32) * 5) * 20,
            )
            for side in ("a", "b")
        ),
    )
    frame.write_parquet(path, compression="lz4", row_group_size=25 * per_cycle, statistics=False)
    return frame.height


def recovered(map_path: Path, speeds: int, pressures: int) -> dict[str, float]:
    """Compare the map with the truth: largest and rms relative error of friction."""
    from pneudrive.characterise import read_map

    curves = read_map(map_path)
    gauge = np.repeat(np.linspace(*GAUGE_PA, pressures), speeds * 2)
    speed = np.tile(np.repeat(np.linspace(*SPEEDS_M_S, speeds), 2), pressures)
    truth = np.array([friction_n(v, p) for v, p in zip(speed, gauge, strict=True)])
    error = curves["friction_n"].to_numpy() / truth - 1
    return {"largest_error": float(np.abs(error).max()), "rms_error": float(np.sqrt(np.mean(error**2)))}


def main() -> None:
    """Make, measure, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--speeds", type=int, default=500)
    parser.add_argument("--pressures", type=int, default=15)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--keep", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
        folder = options.folder if options.keep and options.folder else Path(scratch)
        campaign, layout, out = (folder / name for name in ("campaign.parquet", "layout.toml", "map.parquet"))
        layout.write_text(LAYOUT)
        start = time.perf_counter()
        samples = make_campaign(campaign, options.speeds, options.pressures)
        size = campaign.stat().st_size / 2**30
        print(f"made {samples / 1e6:.1f} million samples, {size:.2f} GiB, in {time.perf_counter() - start:.1f} s")
        command = [sys.executable, "-c", MEASURED, str(campaign), str(layout), str(out)]
        result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        result |= {"samples": samples, **recovered(out, options.speeds, options.pressures)}
    print(json.dumps(result, indent=1))
    print(f"{result['seconds']:.1f} s (bar {BAR_SECONDS:g} s), {result['gib']:.2f} GiB (bar {BAR_GIB:g} GiB)")


if __name__ == "__main__":
    main()
