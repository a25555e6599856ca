"""From where the page may be reached: this machine, or an address of it with a certificate and users."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.web.guard import NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

HOST = NAMES[0]
#: Between two names and passwords that are tried; one is tried at a time, s.
PAUSE_S = 1.0


@dataclass(frozen=True)
class WebReach:
    """From where the page may be reached.

    Attributes
    ----------
    bind : str
        Address of this machine on which the server listens.
    certificate, key : Path or None
        Of the server, PEM.
    users : dict
        Name -> salted hash of the password; who logs in gets the token. Empty: the printed address has the token.
    """

    bind: str = HOST
    certificate: Path | None = None
    key: Path | None = None
    users: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls, bind: str, certificate: Path | None, key: Path | None, user_file: Path | None, *, unprotected: bool
    ) -> WebReach:
        """Check what a user asks for.

        Raises
        ------
        CommandError
            The address is every one of this machine, or another machine reaches it without certificate and users.
        RigError
            The file of users cannot be read, or others may read it.
        """
        import ssl  # the address is printed before what serves it is imported

        is_here = bind in NAMES or bind == "::1"
        if bind in ("", "*") or _is_every(bind):
            raise CommandError(
                f"--bind {bind} is every address of this machine",
                rule="one address or name, as it stands in the browser: the page answers to no other",
                remedy="Name that address.",
            )
        if (certificate is None) != (key is None):
            raise CommandError("--certificate and --key are needed together", remedy="pneudrive rig certificate NAME")
        if not is_here and not unprotected and (certificate is None or user_file is None):
            raise CommandError(
                f"--bind {bind} needs --certificate, --key and --user-file",
                rule="anyone who reaches this address could read what passes, and use the page",
                remedy="Stay on this machine and use ssh -L; give all three; or add --unprotected.",
            )
        if certificate is not None and key is not None:
            try:
                ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)
            except (OSError, ssl.SSLError) as error:
                what = f"certificate {certificate} and key {key} cannot be used"
                raise CommandError(f"{what}: {error.strerror or error}") from None
        if user_file is None:
            return cls(bind, certificate, key)
        from pneudrive.rig.opcua.access import read_users

        return cls(bind, certificate, key, read_users(user_file))

    @property
    def scheme(self) -> str:
        """How the address begins."""
        return "http" if self.certificate is None else "https"

    @property
    def name(self) -> str:
        """The address as it stands in a browser."""
        return f"[{self.bind}]" if ":" in self.bind else self.bind

    @property
    def names(self) -> tuple[str, ...]:
        """Hosts that a request may name."""
        return NAMES if self.bind == HOST else tuple(dict.fromkeys((self.name, *NAMES)))


def _is_every(bind: str) -> bool:
    """Return whether an address stands for all of this machine."""
    import ipaddress

    try:
        return ipaddress.ip_address(bind).is_unspecified
    except ValueError:  # a name
        return False


class Door:
    """Gives the token to who has a name and its password.

    Parameters
    ----------
    users : dict
        Name -> salted hash.
    token : str
    """

    def __init__(self, users: Mapping[str, str], token: str) -> None:
        import asyncio

        self._users, self._token = users, token
        self._one_at_a_time = asyncio.Lock()

    async def token_for(self, user: str, password: str) -> str:
        """Return the token.

        Raises
        ------
        CommandError
            The name or the password is wrong.
        """
        import asyncio

        from pneudrive.rig.opcua.access import is_password

        async with self._one_at_a_time:
            if await asyncio.to_thread(is_password, self._users.get(user, ""), password):
                return self._token
            await asyncio.sleep(PAUSE_S)
        raise CommandError("the name or the password is wrong")
