"""Every drive of the catalogue simulates, and every value has a source that is in references.bib, or a reason."""

import pytest

import pneudrive as pn
from pneudrive.describe import catalogue
from pneudrive.references import bibtex

DRIVES = [name for name, e in catalogue.entries().items() if e.kind == "drive"]

# What a trajectory calls its drive: another hash means that runs of before are of another drive.
HASHES = {
    "festo-dsbg-32-100-sy3000": "35cc3a295bb5cf91f1c5647a1d75cd700a302ab6e80855f2ae578375c30dedc7",
    "parker-osp-p25-mpye": "62cc2f6a8d8ef90912c052bcbd31c2ec7f1f9621d8a97ef27c3d730858aa0ae8",
    "parker-osp-p25-sy5000": "88fe96511a2f242b1339a0244d1c4743ee0ea469c0c6e8e357c3cb75744ac4a0",
    "parker-osp-p40-sy7000": "601ad1483eb0fe786677f1f5065cc2af60fdc84315f65b1579befa52df9e3e4a",
    "reference": "6dd42b38838bd530334e75ffcda9d794a940c8a1734304a60ebb3537f6798480",
    "smc-cm2y-25-sy3000": "743dc9905513c8ca5c2aa5df26d258b964f296f1f766a1d08ff429ea0572fc84",
    "starter": "fd82bc649a38af3cdb2eb1868a575099429b48a2370cf129256091f7b5ae20a1",
}


def test_a_description_keeps_its_hash():
    assert {name: pn.Drive.load(f"catalogue:{name}").description_hash for name in DRIVES} == HASHES


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
