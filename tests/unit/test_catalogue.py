"""Every drive of the catalogue simulates, and every value has a source that is in references.bib, or a reason."""

import pytest

import pneudrive as pn
from pneudrive.describe import catalogue
from pneudrive.references import bibtex

DRIVES = [name for name, e in catalogue.entries().items() if e.kind == "drive"]


@pytest.mark.parametrize("name", DRIVES)
def test_drives_run(name):
    run = pn.simulate(pn.Drive.load(f"catalogue:{name}"), [(0.0, 1.0)], "0.2 s", initial="position = 20 mm")
    assert run.position[-1] > 0.02
    assert run.pressure_a[-1] > run.pressure_a[0]


def test_every_value_has_a_source_or_a_reason():
    values = [v for e in catalogue.entries().values() for v in e.values]
    for v in values:
        assert bibtex(v.source).startswith("@") if v.source else v.assumed
    real = [name for name in DRIVES if name != "reference"]
    assert len(real) >= 3
    for name in real:
        assert any(v.source for v in catalogue.all_values(catalogue.entry(name)))


def test_a_value_without_source_or_reason_is_refused(tmp_path):
    path = tmp_path / "part.toml"
    path.write_text('kind = "valve"\ntitle = "x"\n\n[values]\nconductance = { value = "2 dm3/(s bar)" }\n')
    with pytest.raises(pn.errors.DescriptionError, match=r"conductance has neither a source nor a reason.*part.toml:5"):
        catalogue._read(path)
