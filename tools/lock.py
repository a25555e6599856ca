"""Write or check the Python lock files under requirements/.

A lock file holds names, versions and hashes, and no registry. It therefore installs from the index that the user's
machine is set up for (docs/decisions/0001-lock-files.md).

    python tools/lock.py            write the locks again, keeping pinned versions that still fit
    python tools/lock.py --upgrade  take the newest versions
    python tools/lock.py --check    are they in step with pyproject.toml? (offline)
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ROOT / "requirements"
PYTHON = "3.11"  # oldest Python of the development environment; the package itself supports 3.10
UV = "uv==0.13.8"  # what installs everything else

# lock file -> extras that it adds to the base dependencies; later ones keep the versions of dev.txt
EXTRAS = {
    "dev.txt": ["dev"],
    "docs.txt": ["docs"],
    "bench.txt": ["bench"],
    "fortran.txt": ["bench", "fortran"],
    "extras.txt": ["extras"],
    "page.txt": ["page", "notebook"],
}


def fingerprint(name: str) -> str:
    """SHA-256 of everything in pyproject.toml that decides what this lock file holds."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = {"base": project["dependencies"], "python": PYTHON}
    if name == "bootstrap.txt":
        wanted = {"uv": UV, "python": PYTHON}
    else:
        wanted |= {
            extra: extras[extra]
            for extra in [*EXTRAS[name], "dask", "formats", "gym", "linear", "mujoco", "pdf", "rig", "web"]
        }
    return hashlib.sha256(json.dumps(wanted, sort_keys=True).encode()).hexdigest()


def header(name: str) -> str:
    """First lines of a lock file: the command that renews it, and its inputs."""
    return f"# Written by `make lock`; do not edit.\n# made from: {fingerprint(name)}\n"


def write(name: str, upgrade: bool) -> None:
    """Resolve one lock file with uv and put our header on top."""
    target = LOCKS / name
    uv = Path(sys.executable).parent / "uv"
    command = [uv, "pip", "compile", "--universal", "--python-version", PYTHON, "--generate-hashes"]
    command += ["--no-header", "--no-annotate", "--no-emit-package", "pneudrive", "--quiet", "-o", str(target)]
    if upgrade:
        command.append("--upgrade")
    source = None
    if name == "bootstrap.txt":
        command.append("-")
        source = UV
    else:
        command.append("pyproject.toml")
        for extra in EXTRAS[name]:
            command += ["--extra", extra]
        if name != "dev.txt":
            command += ["-c", "requirements/dev.txt"]
    environment = {k: v for k, v in os.environ.items() if k not in {"UV_INDEX_URL", "UV_EXTRA_INDEX_URL"}}
    subprocess.run(command, cwd=ROOT, check=True, input=source, text=True, env=environment)
    target.write_text(header(name) + target.read_text())


def check(name: str) -> list[str]:
    """Return the faults of a lock file, in words."""
    path = LOCKS / name
    if not path.is_file():
        return [f"{path.relative_to(ROOT)} is missing"]
    text = path.read_text()
    wrong = []
    if not text.startswith(header(name)):
        wrong.append(f"requirements/{name} was not made from this pyproject.toml")
    if "://" in text:
        wrong.append(f"requirements/{name} names a registry or an address; it may hold names, versions and hashes only")
    return wrong


def main() -> int:
    """Run the command line; the exit status is 1 when a lock file is not in step."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--upgrade", action="store_true")
    arguments = parser.parse_args()
    names = ["bootstrap.txt", *EXTRAS]
    if not arguments.check:
        for name in names:
            write(name, arguments.upgrade)
        return 0
    wrong = [message for name in names for message in check(name)]
    for message in wrong:
        print(f"{message}: run `make lock` and commit the result", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
