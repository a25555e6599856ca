"""The wheel: built with core and page, and tested without Rust and node.

python tools/wheel.py build    -> out/wheels/, from what `make setup` has built
python tools/wheel.py try      installs it into an empty environment: the demo, the page, an FMU
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import urllib.request
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WHEELS = ROOT / "out" / "wheels"
PAGE = "pneudrive/web/built/index.html"
MOST_BYTES = 10_000_000


def build() -> Path:
    """Build the wheel; stop where it is too large or lacks a part."""
    shutil.rmtree(WHEELS, ignore_errors=True)
    words = ["maturin", "build", "--release", "--quiet", "--out", str(WHEELS)]
    subprocess.run([Path(sys.executable).with_name(words[0]), *words[1:]], cwd=ROOT, check=True)
    (wheel,) = WHEELS.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        parts = sorted(((one.compress_size, one.filename) for one in archive.infolist()), reverse=True)
    size = wheel.stat().st_size
    print(f"{wheel.relative_to(ROOT)}: {size / 1e6:.2f} MB, {len(names)} files")
    for bytes_, name in parts[:4]:
        print(f"{bytes_ / 1e6:9.2f} MB {name}")
    version = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]["version"]
    wrong = [] if size < MOST_BYTES else [f"{size} bytes are more than {MOST_BYTES}"]
    wrong += [] if wheel.name.startswith(f"pneudrive-{version}-") else [f"its version is not {version}"]
    wrong += [] if PAGE in names else [f"it lacks {PAGE}"]
    if wrong:
        sys.exit("wheel: " + "; ".join(wrong))
    return wheel


def attempt() -> None:
    """Install the wheel into an empty environment, outside of the source, and use it there without Rust and node."""
    (wheel,) = WHEELS.glob("*.whl")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        venv.create(home / "venv", with_pip=True)
        bin_ = home / "venv" / "bin"
        # The path contains only the environment: no Rust, no node, no compiler.
        clean = {"PATH": str(bin_), "HOME": folder, "TMPDIR": folder, "LANG": "C.UTF-8"}
        clean |= {key: value for key, value in os.environ.items() if key.startswith(("PIP_", "SSL_", "HTTP"))}

        def run(*words: str) -> str:
            done = subprocess.run(words, cwd=home, env=clean, capture_output=True, text=True, check=False)
            if done.returncode:
                sys.exit(f"wheel: {' '.join(words)} ends with {done.returncode}\n{done.stdout}{done.stderr}")
            return done.stdout

        run("pip", "install", "--quiet", "--disable-pip-version-check", f"{wheel}[web]")
        print(run("pneudrive", "--version").strip())
        print(run("pneudrive", "demo").strip())
        print(run("pneudrive", "export", "catalogue:reference", "--to", "fmu", "--out", "drive.fmu").splitlines()[0])
        words = ["pneudrive", "web", "studies", "--no-browser", "--port", "0"]
        (home / "studies").mkdir()
        server = subprocess.Popen(words, cwd=home, env=clean, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout
            address = server.stdout.readline().strip()
            with urllib.request.urlopen(address.partition("#")[0]) as answer:
                page = answer.read().decode()
            if answer.status != 200 or "/assets/index-" not in page:
                sys.exit("wheel: pneudrive web does not show its page")
            print(f"pneudrive web: {address.partition('#')[0]} answers {answer.status}, {len(page)} bytes")
        finally:
            server.kill()
            server.communicate()


def main() -> int:
    """Run the command line."""
    match sys.argv[1:]:
        case ["build"]:
            build()
        case ["try"]:
            attempt()
        case _:
            print(__doc__, file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
