"""From another machine the page is reached with a certificate and a password, or where a user says so; else not."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from pneudrive.cli.main import run as run_command
from pneudrive.errors import CommandError
from pneudrive.rig.opcua.access import add_user, make_certificate
from pneudrive.web import reach
from pneudrive.web.app import make_app
from pneudrive.web.reach import WebReach
from pneudrive.web.workspace import Workspace
from web.conftest import PORT, TOKEN, Served

OTHER = "192.0.2.7"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--bind", OTHER], "needs --certificate, --key and --user-file"),
        (["--bind", OTHER, "--user-file", "users"], "needs --certificate"),
        (["--bind", OTHER, "--certificate", "a.pem", "--key", "a.key"], "and --user-file"),
        (["--bind", OTHER, "--certificate", "a.pem", "--user-file", "users"], "needed together"),
        (["--bind", "0.0.0.0", "--unprotected"], "every address"),
        (["--bind", "::", "--unprotected"], "every address"),
        (["--certificate", "users", "--key", "a.key"], "cannot be used"),
        (["--bind", OTHER, "--unprotected"], f"of {OTHER} cannot be used"),  # allowed, but none of this machine's
    ],
)
def test_an_address_that_others_reach_needs_protection(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, options: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    make_certificate(tmp_path, "a")
    add_user(tmp_path / "users", "ada", "secret")
    assert run_command(["web", ".", "--no-browser", *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_file_of_users_that_others_may_read_is_refused(tmp_path: Path) -> None:
    add_user(tmp_path / "users", "ada", "secret")
    (tmp_path / "users").chmod(0o644)
    with pytest.raises(Exception, match="others may read"):
        WebReach.of(OTHER, *make_certificate(tmp_path, "a"), tmp_path / "users", unprotected=False)


def test_who_knows_the_password_gets_the_token_and_nobody_guesses_fast(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach, "PAUSE_S", 0.2)
    add_user(tmp_path / "users", "ada", "secret")
    found = WebReach.of(OTHER, *make_certificate(tmp_path, "a"), tmp_path / "users", unprotected=False)
    built = served.folder.parent / "built"
    served.client._transport.app = make_app(Workspace.at(served.folder), PORT, TOKEN, built, reach=found)
    own = {"host": f"{OTHER}:{PORT}", "origin": f"https://{OTHER}:{PORT}", "sec-fetch-site": "same-origin"}
    began = time.monotonic()
    for given in ({"user": "ada", "password": "Secret"}, {"user": "bob", "password": "secret"}, {"user": "ada"}, {}):
        answer = served.client.post("/api/login", json=given, headers=own)
        assert answer.status_code == 401
        assert TOKEN not in answer.text
    assert time.monotonic() - began > 0.4
    rebound = own | {"host": f"evil.example:{PORT}"}
    assert (
        served.client.post("/api/login", json={"user": "ada", "password": "secret"}, headers=rebound).status_code == 421
    )
    plain = own | {"origin": f"http://{OTHER}:{PORT}"}
    assert (
        served.client.post("/api/login", json={"user": "ada", "password": "secret"}, headers=plain).status_code == 403
    )
    assert served.client.get("/api/studies", headers=own).status_code == 401
    answer = served.client.post("/api/login", json={"user": "ada", "password": "secret"}, headers=own)
    assert answer.json() == {"token": TOKEN}
    given = own | {"authorization": f"Bearer {TOKEN}"}
    assert served.client.get("/api/studies", headers=given).status_code == 200


def test_without_users_nobody_logs_in(served: Served) -> None:
    headers = {key: value for key, value in served.headers.items() if key != "authorization"}
    assert served.client.post("/api/login", json={"user": "", "password": ""}, headers=headers).status_code == 401
    with pytest.raises(CommandError, match="is every address"):
        WebReach.of("", None, None, None, unprotected=True)
