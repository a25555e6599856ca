"""Who may command a rig: a stranger's certificate, a wrong user or password is refused, on both sides.

The server of pneudrive admits certificates. A server of others may also ask for a user.
"""

from __future__ import annotations

import asyncio
import stat
from contextlib import ExitStack
from pathlib import Path

import pytest
from asyncua import Client, ua

from pneudrive.cli.main import run
from pneudrive.errors import CommandError, PneudriveWarning, RigError
from pneudrive.rig import load_rig
from pneudrive.rig.opcua.access import OpcUaFile, Protection, der, make_certificate
from pneudrive.rig.opcua.client import open_rig
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer

PASSWORD = "correct horse"
URL = "opc.tcp://127.0.0.1:1"
NOBODY = {"user": None, "password_file": None}
ENCRYPTED = 'certificate = "client.pem"\nkey = "client.key"\nserver_certificate = "server.pem"\n'


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("certificates")
    for name in ("server", "client", "stranger", "carla"):
        assert run(["rig", "certificate", name, "--out", str(folder), "--host", "localhost"]) == 0
    for name, password in (("password", PASSWORD), ("other", "wrong")):
        (folder / name).write_text(f"{password}\n")
        (folder / name).chmod(0o600)
    return folder


class Users(Protection):
    """Protection of a server of others: a user logs in by name and password, or by certificate."""

    async def protect(self, server):
        await super().protect(server)
        server.set_identity_tokens([ua.UserNameIdentityToken, ua.X509IdentityToken])

    def get_user(self, iserver, *, username, password, certificate):
        if username is None:
            known = certificate == der(self.certificate.with_name("carla.pem"))
        else:
            known = (username, password) == ("anna", PASSWORD) and certificate in self.trusted
        return super().get_user(iserver, certificate=self.trusted[0]) if known else None


@pytest.fixture(scope="module")
def urls(files):
    """Address of a server with each protection."""
    with ExitStack() as running:
        yield {
            kind: running.enter_context(
                RigServer(
                    load_rig("default", seed=3),
                    load_map(),
                    port=0,
                    protection=kind.of(files / "server.pem", [files / "client.pem"]),
                )
            ).url
            for kind in (Protection, Users)
        }


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


@pytest.mark.parametrize("source", ["file", "env"])
def test_a_password_is_sent_and_said(urls, files, monkeypatch, source):
    given = {"file": "password", "env": "PNEUDRIVE_RIG_PASSWORD"}[source]
    monkeypatch.setenv("PNEUDRIVE_RIG_PASSWORD", PASSWORD)
    own = f'url = "{urls[Users]}"\nuser = "anna"\npassword_{source} = "{given}"\n'
    (files / "bench.toml").write_text('kind = "opc-ua"\n' + own + ENCRYPTED)
    with pytest.warns(PneudriveWarning, match=f"the password in {given} is sent to 127.0.0.1:.*, as bench.toml states"):
        rig = load_rig(files / "bench.toml")
    rig.home()
    rig.close()


def test_a_user_logs_in_by_certificate(urls, files):
    """The client signs with the key of the user; the key of another one is refused."""
    carla = NOBODY | {"user_certificate": "carla.pem"}
    rig = open_rig(access(files, urls[Users], **carla, user_key="carla.key"))
    rig.home()
    rig.close()
    with pytest.raises(RigError, match="rejects this client"):
        open_rig(access(files, urls[Users], **carla, user_key="stranger.key"))


@pytest.mark.parametrize(
    ("kind", "who", "words"),
    [
        (Protection, NOBODY | {"certificate": "stranger"}, "rejects this client: BadCertificateUntrusted"),
        (Protection, NOBODY | {"server": "stranger"}, "server_certificate is not its certificate"),
        (Protection, {}, "rejects this client: BadIdentityTokenRejected"),
        (Protection, None, "rejects this client: .*No matching endpoints"),
        (Users, {"user": "carl"}, "rejects this client: BadUserAccessDenied"),
        (Users, {"user": "jürgen"}, "rejects this client: BadUserAccessDenied"),
        (Users, {"password_file": "other"}, "rejects this client: BadUserAccessDenied"),
        (Users, NOBODY, "rejects this client: BadIdentityTokenRejected"),
    ],
    ids=["certificate", "server", "a user", "nothing", "user", "user in other letters", "password", "no user"],
)
def test_others_are_refused(urls, files, kind, who, words, monkeypatch):
    monkeypatch.setattr("pneudrive.rig.opcua.link.LEAST_TIMEOUT_S", 4.0)  # a server may not answer at all
    with pytest.raises(RigError, match=words):
        open_rig(OpcUaFile(url=urls[kind]) if who is None else access(files, urls[kind], **who))


def test_a_trusted_certificate_is_that_of_the_connection(files):
    """A client may name a trusted certificate, which is public, on a connection with its own."""
    protection = Protection.of(files / "server.pem", [files / "client.pem"])
    assert protection.get_user(None, certificate=der(files / "client.pem")) is not None
    assert protection.get_user(None, certificate=der(files / "stranger.pem")) is None


def test_a_connection_without_a_certificate_cannot_log_in(urls):
    """The client of pneudrive would not even ask."""

    async def ask() -> None:
        client = Client(urls[Protection])
        await client.connect_socket()
        try:
            await client.send_hello()
            await client.open_secure_channel()
            session = ua.CreateSessionParameters(EndpointUrl=urls[Protection], ClientNonce=bytes(32))
            await client.uaclient.create_session(session)
            await client.uaclient.activate_session(ua.ActivateSessionParameters())
        finally:
            client.disconnect_socket()

    with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
        asyncio.run(ask())


def test_secrets_stay_secret(files, tmp_path):
    assert stat.S_IMODE((files / "server.key").stat().st_mode) == 0o600
    with pytest.raises(RigError, match="already exists"):
        make_certificate(files, "server")
    (tmp_path / "password").write_text(PASSWORD)
    (tmp_path / "password").chmod(0o644)
    with pytest.raises(RigError, match=r"(?s)other users may read.*chmod 600"):
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
        ('password = "x"', "a rig file must not contain a password"),
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
    with pytest.raises(CommandError, match="needs --certificate"):
        Protection.of(None, [files / "client.pem"])
    with pytest.raises(CommandError, match="needs --trust"):
        Protection.of(files / "server.pem", None)


@pytest.mark.parametrize("url", ["opc.tcp://127.0.0.1:4840,", "opc.tcp://127.0.0.1:99999"])
def test_an_address_that_is_none_is_refused_in_words(url):
    with pytest.raises(RigError, match="not an address"):
        load_rig(url)
