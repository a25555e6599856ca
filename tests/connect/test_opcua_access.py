"""Who may command a rig: a stranger's certificate, a wrong user or password is refused, on both sides."""

from __future__ import annotations

import io
import stat
from pathlib import Path

import pytest

from pneudrive.cli.main import run
from pneudrive.errors import CommandError, RigError
from pneudrive.rig import load_rig
from pneudrive.rig.opcua.access import OpcUaFile, Protection, make_certificate
from pneudrive.rig.opcua.client import open_rig
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer

PASSWORD = "correct horse"
URL = "opc.tcp://127.0.0.1:1"


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("certificates")
    for name in ("server", "client", "stranger", "carla"):
        assert run(["rig", "certificate", name, "--out", str(folder), "--host", "localhost"]) == 0
    with pytest.MonkeyPatch.context() as patch:
        for name, password in (("anna", "old"), ("bert", "another"), ("anna", PASSWORD)):
            patch.setattr("sys.stdin", io.StringIO(f"{password}\n"))
            assert run(["rig", "user", name, "--user-file", str(folder / "users")]) == 0
    (folder / "password").write_text(f"{PASSWORD}\n")
    (folder / "password").chmod(0o600)
    return folder


@pytest.fixture(scope="module")
def served(files):
    protection = Protection.of(files / "server.pem", [files / "client.pem"], files / "users")
    with RigServer(load_rig("default", seed=3), load_map(), port=0, protection=protection) as server:
        yield server


def access(files: Path, url: str, certificate: str = "client", server: str = "server", **fields: object) -> OpcUaFile:
    encryption = {
        "certificate": f"{certificate}.pem",
        "key": f"{certificate}.key",
        "server_certificate": f"{server}.pem",
    }
    keys = {"user": "anna", "password_file": "password", **encryption, **fields}
    file = OpcUaFile.model_validate({"url": url} | {key: value for key, value in keys.items() if value is not None})
    file._folder = files
    return file


def test_a_password_from_the_environment(served, files, monkeypatch):
    monkeypatch.setenv("PNEUDRIVE_RIG_PASSWORD", PASSWORD)
    rig = open_rig(access(files, served.url, password_file=None, password_env="PNEUDRIVE_RIG_PASSWORD"))
    rig.home()
    rig.close()


def test_a_server_of_others_may_admit_the_certificate_of_a_user(files):
    """Another server than that of pneudrive: the client signs with the key of the user."""
    import asyncio

    from asyncua import Server
    from asyncua.crypto.permission_rules import User, UserRole

    from pneudrive.rig.opcua.access import der, protect, ua
    from pneudrive.rig.opcua.link import Link, LoopThread

    nobody = {"user": None, "password_file": None}
    users = []

    class Admit:
        def get_user(self, _, username=None, password=None, certificate=None):
            users.append(certificate)
            return User(role=UserRole.User)

    async def start() -> Server:
        server = Server()
        await server.init()
        server.set_endpoint("opc.tcp://127.0.0.1:0")
        await protect(server, Protection.of(files / "server.pem", [files / "client.pem"], None))
        server.iserver.set_user_manager(Admit())
        server.set_identity_tokens([ua.X509IdentityToken])
        await server.start()
        return server

    loop = LoopThread()
    server = loop.run(start())
    url = f"opc.tcp://127.0.0.1:{server.bserver.port}"
    for key, admitted in (("carla", True), ("stranger", False)):  # the second one is not her key
        own = {"user_certificate": "carla.pem", "user_key": f"{key}.key"}
        link = Link(access(files, url, **nobody, **own), load_map())
        with pytest.raises(RigError, match="no namespace" if admitted else "rejects this client"):
            link.connect()
        link.close()
    assert users == [der(files / "carla.pem")]
    loop.run(asyncio.wait_for(server.stop(), 5.0))
    loop.close()


@pytest.mark.parametrize(
    ("who", "words"),
    [
        ({"certificate": "stranger"}, "rejects this client: BadCertificateUntrusted"),
        ({"user": "carl"}, "rejects this client: BadUserAccessDenied"),
        ({"user": "jürgen"}, "rejects this client: BadUserAccessDenied"),
        ({"user": "bert"}, "rejects this client: BadUserAccessDenied"),
        ({"user": None, "password_file": None}, "rejects this client: BadIdentityTokenRejected"),
        ({"server": "stranger"}, "server_certificate is not its certificate"),
        (None, "rejects this client: .*No matching endpoints"),
    ],
    ids=["certificate", "user", "user in other letters", "password", "no user", "server", "nothing"],
)
def test_others_are_refused(served, files, who, words):
    with pytest.raises(RigError, match=words):
        open_rig(OpcUaFile(url=served.url) if who is None else access(files, served.url, **who))


def test_secrets_stay_secret(files, tmp_path):
    for name in ("server.key", "users"):
        assert stat.S_IMODE((files / name).stat().st_mode) == 0o600
    assert PASSWORD not in (files / "users").read_text()
    with pytest.raises(RigError, match="already exists"):
        make_certificate(files, "server")
    (tmp_path / "password").write_text(PASSWORD)
    (tmp_path / "password").chmod(0o644)
    with pytest.raises(RigError, match=r"(?s)others may read.*chmod 600"):
        access(tmp_path, URL).read_password()
    (tmp_path / "private").write_text(PASSWORD)
    (tmp_path / "private").chmod(0o600)
    (tmp_path / "link").symlink_to("private")
    with pytest.raises(RigError, match=r"(?s)is a link.*private file"):
        access(tmp_path, URL, password_file="link").read_password()
    with pytest.raises(RigError, match="is empty or not set"):
        access(tmp_path, URL, password_file=None, password_env="PNEUDRIVE_NO_SUCH_VARIABLE").read_password()


START = 'kind = "opc-ua"\nurl = "opc.tcp://127.0.0.1:1"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('password = "x"', "a rig file contains no password itself"),
        ('user = "anna"', "a password is sent only over an encrypted connection"),
        ('certificate = "c.pem"', "needed together"),
        ('password_env = "SERVICE_TOKEN"', "only variables whose names begin with PNEUDRIVE_"),
        ('password_file = "/home/me/.ssh/id_ed25519"', "in the folder of the rig file"),
        ('password_file = "../.ssh/id_ed25519"', "in the folder of the rig file"),
        ('password_file = "link/id_ed25519"', "in the folder of the rig file"),
        ('password_file = "~"', "in the folder of the rig file"),
        ('certifikate = "c.pem"', "Did you mean 'certificate'"),
    ],
)
def test_rig_files_that_would_give_a_secret_away(tmp_path, text, words):
    (tmp_path / "bench.toml").write_text(START + text)
    with pytest.raises(RigError, match=rf"(?s)bench.toml:3.*{words}"):
        load_rig(tmp_path / "bench.toml")
    (tmp_path / "bench.toml").write_text(START.replace("opc.tcp://", "opc.tcp://anna:x@"))
    with pytest.raises(RigError, match="without user and password"):
        load_rig(tmp_path / "bench.toml")


def test_a_server_is_not_open_to_the_network_by_mistake(files, refusal):
    refusal(["rig", "serve", "--bind", "0.0.0.0"], "anyone who reaches this address could move the axis")
    with pytest.raises(CommandError, match="need --certificate"):
        Protection.of(None, None, files / "users")
    with pytest.raises(CommandError, match="needs --trust"):
        Protection.of(files / "server.pem", None, None)


@pytest.mark.parametrize("url", ["opc.tcp://127.0.0.1:4840,", "opc.tcp://127.0.0.1:99999"])
def test_an_address_that_is_none_is_refused_in_words(url):
    with pytest.raises(RigError, match="not an address"):
        load_rig(url)


def test_users_that_cannot_be_written_are_one_message(tmp_path, monkeypatch, refusal):
    monkeypatch.setattr("sys.stdin", io.StringIO("secret\n"))
    refusal(
        ["rig", "user", "anna", "--user-file", tmp_path / "nowhere" / "users"],
        "users cannot be written: No such file or directory",
    )
