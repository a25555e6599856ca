"""The overview has a line about each file; a damaged file has none and hides no other."""

from __future__ import annotations

import pneudrive as pn
from pneudrive.characterise import write_map
from web.conftest import Served
from web.maps import WIDE, friction_map, stribeck
from web.test_sizing import TASK


def test_each_file_says_what_it_holds(served: Served) -> None:
    curves = friction_map(stribeck, WIDE, (0.0, 2e5), 0.2)
    write_map(curves, served.folder / "map.parquet")
    fit = pn.fit_friction(curves, pressure_dependence=True)
    fit.to_toml(served.folder / "fit.toml")
    (served.folder / "push.toml").write_text(TASK)
    (served.folder / "wrong.toml").write_text("[cylinder]\nbore = 'x'\n[valve]\n[supply]\n")
    (served.folder / "wrong.fmu").write_text("no archive")
    found = served.client.get("/api/headlines", headers=served.headers).json()
    assert found["axis.toml"].endswith("bore 25 mm, stroke 500 mm")
    assert found["push.toml"] == "push: 2 kg, 100 mm in 0.42 s"
    assert found["map.parquet"] == f"{curves.sizes['row']} points of friction"
    assert f"coulomb {fit.values['coulomb']:.3g} N" in found["fit.toml"]
    assert not {"wrong.toml", "wrong.fmu"} & set(found)
