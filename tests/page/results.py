"""A folder with a result of every kind, small and quickly made."""

from __future__ import annotations

import shutil
from pathlib import Path

import polars as pl

import pneudrive as pn
from oracle.drive_records import drive, record
from page.conftest import ROOT
from pneudrive.campaign.run import run_campaign
from pneudrive.characterise import write_map
from web.maps import WIDE, friction_map, stribeck
from web.test_lineage import PROTOCOL
from web.test_sizing import TASK

MEASURED = ROOT / "data" / "measurements" / "zillen-2021-pneumatic-piston"
RECORDING = "O-ring_1bar.csv.xz"
STEPS = "0 s: 0.3, 0.4 s: -0.3"


def make_results(folder: Path) -> None:
    """Write drives, recordings, maps, fits, a validation, a sizing, a comparison, a campaign and an FMU."""
    (folder / "axis.toml").write_text(drive().to_toml())
    before = pn.Drive.load(folder / "axis.toml")
    (folder / "push.toml").write_text(TASK)
    (folder / "speeds.toml").write_text(PROTOCOL)
    for name in ("layout.toml", f"friction/{RECORDING}"):
        shutil.copy(MEASURED / name, folder)
    pl.DataFrame(record(before, 3, duration_s=1.0).columns).write_parquet(folder / "monday.parquet")
    pn.save(pn.simulate(before, STEPS, "0.8 s"), folder / "run.parquet")
    fit = pn.identify(before, folder / "monday.parquet", ["valve.conductance"])
    fit.to_toml(folder / "fit.toml")
    (folder / "after.toml").write_text(fit.apply().to_toml())
    after = pn.Drive.load(folder / "after.toml")
    results = folder / "results"
    for name in ("check", "new", "worn"):
        (results / name).mkdir(parents=True)
    weak = record(drive(valve__conductance="1.6 dm3/(s bar)"), 4, duration_s=1.0)
    pl.DataFrame(weak.columns).write_parquet(folder / "friday.parquet")
    pn.validate(after, folder / "friday.parquet").write(results / "check")
    for name, worn in (("new", 0.0), ("worn", 4.0)):
        curves = friction_map(lambda v, g, more=worn: stribeck(v, g) + more, WIDE, (0.0, 2e5), 0.2)
        write_map(curves, results / name / "map.parquet")
        pn.fit_friction(curves, pressure_dependence=True).to_toml(results / name / "fit.toml")
    pn.size(folder / "push.toml", draws=8, draws_best=16, out=results / "push")
    pn.control.benchmark(before, ["pid", "inversion"], ["R1"], seeds=2, out=results / "laws")
    run_campaign(folder / "speeds.toml", "default", folder / "campaigns" / "first")
    pn.export_fmu(before, folder / "drive.fmu")
