"""An archive that is damaged, or is not an FMU, is refused in one sentence, whatever its libraries raise."""

import random
import zipfile

import pytest

from pneudrive.errors import CommandError
from pneudrive.fmu.description import read_fmu

XML = (
    '<?xml version="1.0" encoding="{}"?><fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">'
    '<CoSimulation modelIdentifier="m"/><ModelVariables><Float64 name="x" causality="output" valueReference="1"/>'
    "</ModelVariables></fmiModelDescription>"
)


def archive(path, text, name="modelDescription.xml"):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, text)
    return path


def test_a_sound_one_is_read(tmp_path):
    found = read_fmu(archive(tmp_path / "m.fmu", XML.format("utf-8")))
    assert (found.version, found.kinds, [one.name for one in found.variables]) == ("3.0", ("CoSimulation",), ["x"])


@pytest.mark.parametrize("name", ["no-such", "utf-7", "idna", "base64"])
def test_an_unknown_encoding(tmp_path, name):
    with pytest.raises(CommandError, match="not an FMU that can be read"):
        read_fmu(archive(tmp_path / "m.fmu", XML.format(name)))


def test_damaged_archives(tmp_path):
    path = archive(tmp_path / "m.fmu", XML.format("utf-8") + " " * 500)
    sound = path.read_bytes()
    refused = 0
    for seed in range(300):
        rng, data = random.Random(seed), bytearray(sound)
        for _ in range(rng.choice((1, 1, 3, 20))):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(data if rng.random() < 0.8 else data[: rng.randrange(len(data))])
        try:
            read_fmu(path)
        except CommandError:
            refused += 1
    assert refused > 200
