"""A hostile page, another user of the machine, a wrong name: each is refused before anything of the server runs."""

from __future__ import annotations

import asyncio

import pytest
from starlette.websockets import WebSocketDisconnect

from pneudrive.web.serve import MOST_BODY, MOST_SOCKETS, Guard, address, new_token
from web.conftest import PORT, TOKEN, Served

OWN = f"127.0.0.1:{PORT}"
STUDIES = "/api/studies"
GOOD = {"host": OWN, "authorization": f"Bearer {TOKEN}"}
PAGE = GOOD | {"origin": f"http://{OWN}"}

#: How a browser follows a link of another site, such as the file that `pneudrive web` opens.
NAVIGATION = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}

#: What is asked, with which headers, and how it is refused.
PROBES = {
    "rebound name": ("GET", STUDIES, GOOD | {"host": f"evil.example:{PORT}"}, 421),
    "own name as a part": ("GET", STUDIES, GOOD | {"host": f"{OWN}.evil.example"}, 421),
    "own name with a user": ("GET", STUDIES, GOOD | {"host": f"a@{OWN}"}, 421),
    "another port": ("GET", STUDIES, GOOD | {"host": "127.0.0.1:80"}, 421),
    "no port": ("GET", STUDIES, GOOD | {"host": "127.0.0.1"}, 421),
    "private address": ("GET", STUDIES, GOOD | {"host": f"192.168.0.2:{PORT}"}, 421),
    "rebound name, the page": ("GET", "/", {"host": f"evil.example:{PORT}"}, 421),
    "no token": ("GET", STUDIES, {"host": OWN}, 401),
    "empty token": ("GET", STUDIES, GOOD | {"authorization": "Bearer "}, 401),
    "wrong token": ("GET", STUDIES, GOOD | {"authorization": f"Bearer {TOKEN[:-1]}x"}, 401),
    "longer token": ("GET", STUDIES, GOOD | {"authorization": f"Bearer {TOKEN}t"}, 401),
    "token of another scheme": ("GET", STUDIES, GOOD | {"authorization": f"Basic {TOKEN}"}, 401),
    "token in a cookie": ("GET", STUDIES, {"host": OWN, "cookie": f"token={TOKEN}"}, 401),
    "token in the address": ("GET", f"{STUDIES}?token={TOKEN}", {"host": OWN}, 401),
    "unknown path without token": ("GET", "/api/unknown", {"host": OWN}, 401),
    "page of another site": ("GET", STUDIES, GOOD | {"origin": "http://evil.example"}, 403),
    "page of another port": ("GET", STUDIES, GOOD | {"origin": "http://127.0.0.1:3000"}, 403),
    "page of the other name": ("GET", STUDIES, GOOD | {"origin": f"http://localhost:{PORT}"}, 403),
    "page over https": ("GET", STUDIES, GOOD | {"origin": f"https://{OWN}"}, 403),
    "page of a file": ("GET", STUDIES, GOOD | {"origin": "null"}, 403),
    "another port says same-site": ("GET", STUDIES, GOOD | {"sec-fetch-site": "same-site"}, 403),
    "cross-site script": ("GET", STUDIES, GOOD | NAVIGATION, 403),
    "page in a frame": ("GET", "/", {"host": OWN} | NAVIGATION | {"sec-fetch-dest": "iframe"}, 403),
    "cross-site": ("GET", "/", {"host": OWN, "sec-fetch-site": "cross-site"}, 403),
    "form of another page": ("POST", "/api/check", GOOD, 403),
    "written without origin": ("PUT", "/api/file?path=axis.toml", GOOD, 403),
    "deleted": ("DELETE", "/api/file?path=axis.toml", PAGE, 405),
    "asked before": ("OPTIONS", STUDIES, PAGE, 405),
    "traced": ("TRACE", STUDIES, PAGE, 405),
    "too long": ("POST", "/api/check", PAGE | {"content-length": str(MOST_BODY + 1)}, 413),
    "negative length": ("POST", "/api/check", PAGE | {"content-length": "-1"}, 413),
}


@pytest.mark.parametrize("name", PROBES)
def test_a_probe_is_refused(served: Served, name: str) -> None:
    method, path, headers, status = PROBES[name]
    answer = served.client.request(method, path, headers=headers)
    assert answer.status_code == status
    assert "my axis" not in answer.text
    assert "access-control-allow-origin" not in answer.headers


#: A socket of the page: one thing in it is wrong.
SOCKETS = {
    "no origin": ({"host": OWN}, ["pneudrive", f"token.{TOKEN}"]),
    "another origin": ({"host": OWN, "origin": "http://evil.example"}, ["pneudrive", f"token.{TOKEN}"]),
    "rebound name": ({"host": f"evil.example:{PORT}", "origin": f"http://evil.example:{PORT}"}, [f"token.{TOKEN}"]),
    "no token": ({"host": OWN, "origin": f"http://{OWN}"}, ["pneudrive"]),
    "wrong token": ({"host": OWN, "origin": f"http://{OWN}"}, ["pneudrive", "token.x"]),
    "token as a header": ({"host": OWN, "origin": f"http://{OWN}", "authorization": f"Bearer {TOKEN}"}, ["pneudrive"]),
}


@pytest.mark.parametrize("name", SOCKETS)
def test_a_socket_is_refused(served: Served, name: str) -> None:
    headers, protocols = SOCKETS[name]
    with pytest.raises(WebSocketDisconnect), served.client.websocket_connect("/api/live", protocols, headers=headers):
        pass


def test_the_page_of_this_user_is_let_in_and_runs_nothing_of_others(served: Served) -> None:
    assert served.client.get("/", headers={"host": OWN} | NAVIGATION).status_code == 200
    studies = served.client.get(STUDIES, headers=served.headers)
    assert (studies.json()["files"][0]["path"], studies.headers["cache-control"]) == ("axis.toml", "no-store")
    page = served.client.get("/", headers={"host": f"localhost:{PORT}", "sec-fetch-site": "none"})
    assert page.status_code == 200
    rules = dict(part.split(" ", 1) for part in page.headers["content-security-policy"].split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == rules["style-src"] == rules["connect-src"] == "'self'"
    assert rules["frame-ancestors"] == "'none'"
    assert rules["require-trusted-types-for"] == "'script'"
    assert page.headers["x-content-type-options"] == "nosniff"
    assert "set-cookie" not in page.headers
    assert served.client.get("/../app.py", headers=served.headers).status_code == 404


def test_a_body_without_a_length_is_cut_off(served: Served) -> None:
    pieces = (b"x" * 65536 for _ in range(MOST_BODY // 65536 + 1))
    answer = served.client.post("/api/check", headers=served.headers, content=pieces)
    assert answer.status_code == 413


def test_sockets_are_counted(served: Served) -> None:
    served.app.sockets = MOST_SOCKETS
    with pytest.raises(WebSocketDisconnect), served.client.websocket_connect("/api/live", **served.socket):
        pass


def test_a_header_that_is_given_twice_is_refused() -> None:
    async def never(*_: object) -> None:
        raise AssertionError

    sent: list[dict] = []

    async def send(message: dict) -> None:
        sent.append(message)

    headers = [(b"host", OWN.encode()), (b"host", b"evil.example")]
    scope = {"type": "http", "method": "GET", "path": "/", "headers": headers}
    asyncio.run(Guard(never, PORT, TOKEN)(scope, never, send))
    assert sent[0]["status"] == 400


def test_tokens_are_long_and_differ() -> None:
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert all(len(token) >= 32 for token in tokens)
    assert address(PORT, "abc") == f"http://{OWN}/#token=abc"


def test_the_address_of_a_report_opens_that_report_and_nothing_else(served: Served) -> None:
    folder = served.folder / "results" / "one"
    (folder / "figures").mkdir(parents=True)
    (folder / "report.html").write_text("<script>document.title = 'mine'</script>")
    (folder / "figures" / "a.svg").write_text("<svg/>")
    (folder / "figures" / "a.html").write_text("no picture")
    (folder / "secret.toml").write_text("mass = 1")
    (folder / "figures" / "out.svg").symlink_to(served.folder.parent / "built" / "build.json")
    given = {"path": "results/one"}
    path = served.client.get("/api/report", params=given, headers=served.headers).json()["address"]
    assert served.client.get("/api/report", params=given, headers=served.headers).json()["address"] == path
    opened = {"host": OWN, "sec-fetch-site": "same-origin"}
    report = served.client.get(path, headers=opened)
    assert report.text.startswith("<script>")
    rules = dict(f"{part} ".split(" ", 1) for part in report.headers["content-security-policy"].split("; "))
    assert rules["default-src"].strip() == "'none'"
    assert "script-src" not in rules
    assert "allow-scripts" not in rules["sandbox"]
    assert report.headers["x-content-type-options"] == "nosniff"
    above = path.removesuffix("report.html")
    assert len(above.split("/")[2]) >= 32
    assert served.client.get(f"{above}figures/a.svg", headers=opened).status_code == 200
    for name in ("secret.toml", "figures/a.html", "figures/out.svg", "figures/..%2Fsecret.toml", "%2e%2e/x.svg", ""):
        assert served.client.get(f"{above}{name}", headers=opened).status_code == 404, name
    for wrong in (path.replace(above[8:-1], "x" * 32), "/report//report.html", "/report/", f"{above[:-2]}/report.html"):
        assert served.client.get(wrong, headers=opened).status_code == 401, wrong
    assert served.client.get(path, headers=opened | {"sec-fetch-site": "cross-site"}).status_code == 403
    assert served.client.get(path, headers=opened | {"host": f"evil.example:{PORT}"}).status_code == 421
    assert served.client.get(STUDIES, headers=opened).status_code == 401
    assert served.client.get("/api/report", params=given, headers=opened).status_code == 401
    assert served.client.get("/api/report", params={"path": "../x"}, headers=served.headers).status_code == 400
