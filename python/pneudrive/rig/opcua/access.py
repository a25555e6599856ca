"""Access to a rig over OPC UA: certificates, and the login of the client. Rig files never contain passwords."""

from __future__ import annotations

import os
import re
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import asyncua.ua
from asyncua.common.utils import ServiceError
from asyncua.crypto import cert_gen
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from asyncua.crypto.uacrypto import CertProperties
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from pydantic import model_validator

from pneudrive.describe.marks import NOT_NEGATIVE, Quantity, Reads
from pneudrive.errors import CommandError, DescriptionError, RigError, wrong
from pneudrive.rig.rig_file import RigFile

ua: Any = asyncua.ua
SCHEME = "opc.tcp"
RECONNECT_S = 60.0
PREFIX = "PNEUDRIVE_"  # of variables whose content a rig file may send to the server that it names
OTHERS_MAY_READ = 0o077


def _no_password(_: object) -> None:
    remedy = 'Write password_file = "password.txt" or password_env = "PNEUDRIVE_RIG_PASSWORD".'
    raise DescriptionError("the file contains a password", rule="a rig file must not contain a password", remedy=remedy)


def _text(pattern: str, name: str, rule: str, remedy: str | None = None) -> Reads:
    """Return the annotation of a text that matches a pattern."""

    def read(given: object) -> str:
        if not isinstance(given, str) or not re.fullmatch(pattern, given):
            raise DescriptionError(f"{given!r} is not {name}", rule=rule, remedy=remedy)
        return given

    return Reads(read)


ADDRESS = _text(rf"{SCHEME}://[^@]*", "an address", f"{SCHEME}://HOST:PORT, without user and password")
#: Variable for a password. A rig file may only name variables that are for passwords of rigs.
VARIABLE = _text(
    rf"{PREFIX}[^\n]*",
    "an environment variable for the password of a rig",
    f"a rig file may send only variables whose names begin with {PREFIX}",
    'Write password_env = "PNEUDRIVE_RIG_PASSWORD".',
)
#: Name of a password file. A path is rejected, because it could lead to a private file.
PASSWORD_FILE = _text(
    r"(?!~|\.\.|\.$)[^/\\]+",
    "the name of a password file",
    "the password file is in the folder of the rig file, and its name has no path",
    'Write password_file = "password.txt".',
)


class OpcUaFile(RigFile):
    """Rig file of a rig over OPC UA: address, credentials of the client, and certificate of the trusted server.

    With a certificate, messages are signed and encrypted (Basic256Sha256), and only the server with the given
    certificate is accepted. A user logs in with name and password, or with a user certificate. Files are read at each
    connection.
    """

    url: Annotated[str, ADDRESS]
    map: str | None = None
    reconnect_s: Annotated[float, Quantity("s", bounds=NOT_NEGATIVE)] = RECONNECT_S
    user: str | None = None
    password: Annotated[None, Reads(_no_password)] = None
    password_file: Annotated[str | None, PASSWORD_FILE] = None
    password_env: Annotated[str | None, VARIABLE] = None
    user_certificate: str | None = None
    user_key: str | None = None
    certificate: str | None = None
    key: str | None = None
    server_certificate: str | None = None

    @model_validator(mode="after")
    def _access_fits(self) -> OpcUaFile:
        encrypted = (self.certificate, self.key, self.server_certificate)
        if None in encrypted and any(encrypted):
            rule = "certificate and key of the client, and server_certificate, are needed together"
            raise wrong("certificate", "one of the three files for encryption is missing", rule=rule)
        if (self.user or self.user_certificate) is not None and not any(encrypted):
            rule = "a password is sent only over an encrypted connection"
            remedy = "Make certificates with: pneudrive rig certificate."
            raise wrong("user", "a user needs a certificate of the client", rule=rule, remedy=remedy)
        if (self.user_certificate is None) != (self.user_key is None):
            raise wrong("user_certificate", "user_certificate and user_key are needed together")
        if self.user is not None and self.user_certificate is not None:
            raise wrong("user_certificate", "the user is given twice", rule="either user or user_certificate")
        if self.password_file is not None and self.password_env is not None:
            raise wrong("password_env", "the password is given twice", rule="either password_file or password_env")
        return self

    def read_password(self) -> str:
        """Read the password; empty if none is configured.

        Raises
        ------
        RigError
            The file or variable does not exist, or other users may read the file.
        """
        if self.password_env is not None:
            if self.password_env not in os.environ:
                raise RigError.of("rig.variable", name=self.password_env)
            return os.environ[self.password_env]
        if self.password_file is None:
            return ""
        path = self.beside(self.password_file)
        if path.is_symlink():
            raise RigError.of("rig.password-link", file=path)
        return secret(path).decode("utf-8").rstrip("\r\n")

    async def secure(self, client: Any) -> None:  # noqa: ANN401 - asyncua's client
        """Set the credentials of a client before it connects."""
        if self.certificate and self.key and self.server_certificate:
            client.application_uri = application_uri(self.beside(self.certificate))
            await client.set_security(
                SecurityPolicyBasic256Sha256,
                certificate=_properties(read(self.beside(self.certificate))),
                private_key=_properties(secret(self.beside(self.key))),
                server_certificate=_properties(read(self.beside(self.server_certificate))),
            )
            client.certificate_validator = _validator(CertificateValidatorOptions.PEER_SERVER).validate
        if self.user is not None:
            client.set_user(self.user)
            client.set_password(self.read_password())
        if self.user_certificate and self.user_key:
            own = _properties(read(self.beside(self.user_certificate)))
            key = _properties(secret(self.beside(self.user_key)))
            await client.load_client_certificate(own.path_or_content, own.extension)
            await client.load_private_key(key.path_or_content, extension=key.extension)


@dataclass(frozen=True)
class Protection:
    """Certificates of a served rig.

    Attributes
    ----------
    certificate : Path or None
        Certificate of the server, with its key in the same folder (.key). None: no encryption, any client is admitted.
    trusted : tuple of bytes
        Certificates of admitted clients, in DER.
    """

    certificate: Path | None = None
    trusted: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, certificate: Path | None, trusted: list[Path] | None) -> Protection:
        """Read the files named by the options of a command.

        Raises
        ------
        CommandError, RigError
            The options do not fit together, or a file cannot be read.
        """
        if certificate is None:
            if trusted:
                raise CommandError("--trust needs --certificate", remedy="Make one with pneudrive rig certificate.")
            return cls()
        if not trusted:
            raise CommandError("--certificate needs --trust", rule="--trust gives the certificates of admitted clients")
        secret(certificate.with_suffix(".key"))
        return cls(certificate, tuple(map(der, trusted)))

    def get_user(self, _: object, *, certificate: bytes | None, **__: object) -> User | None:
        """Return a user for the certificate of a connection, or None to reject the client."""
        admitted = self.certificate is None or certificate in self.trusted
        return User(role=UserRole.User) if admitted else None

    async def validate(self, certificate: x509.Certificate, application: Any) -> None:  # noqa: ANN401 - asyncua's
        """Check that the certificate of a client is trusted, is valid today, and names the right application."""
        if certificate.public_bytes(Encoding.DER) not in self.trusted:
            raise ServiceError(ua.StatusCodes.BadCertificateUntrusted)
        await _validator(CertificateValidatorOptions.PEER_CLIENT).validate(certificate, application)

    async def protect(self, server: Any) -> None:  # noqa: ANN401 - asyncua's server
        """Set the protection of a server before it starts."""
        server.iserver.set_user_manager(self)
        server.set_identity_tokens([ua.AnonymousIdentityToken])
        if self.certificate is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
            return
        await server.set_application_uri(application_uri(self.certificate))
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        certificate = _properties(read(self.certificate))
        key = _properties(secret(self.certificate.with_suffix(".key")))
        await server.load_certificate(certificate.path_or_content, certificate.extension)
        await server.load_private_key(key.path_or_content, format=key.extension)
        server.set_certificate_validator(self.validate)


def make_certificate(
    folder: Path,
    name: str,
    hosts: list[str] | None = None,
    days: int = 365,
) -> tuple[Path, Path]:
    """Make a self-signed certificate and its key for an OPC UA application, client or server.

    Parameters
    ----------
    folder : Path
        Folder for ``NAME.pem`` and ``NAME.key``, which only the user may read. An existing key is not overwritten.
    name : str
    hosts : list of str, optional
        Names of the computer; default: this computer.
    days : int
        Days of validity.

    Raises
    ------
    RigError
        A file of that name exists or cannot be written.
    """
    certificate_path, key_path = folder / f"{name}.pem", folder / f"{name}.key"
    key, uses = cert_gen.generate_private_key(), x509.oid.ExtendedKeyUsageOID
    names = [
        x509.UniformResourceIdentifier(f"urn:pneudrive:{name}"),
        *map(x509.DNSName, hosts or [socket.gethostname()]),
    ]
    both = [uses.CLIENT_AUTH, uses.SERVER_AUTH]
    made = cert_gen.generate_self_signed_app_certificate(key, name, {}, names, both, days=days)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(key_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(cert_gen.dump_private_key_as_pem(key))
        certificate_path.write_bytes(made.public_bytes(Encoding.PEM))
    except FileExistsError:
        raise RigError(f"{key_path} already exists", remedy="Choose another name, or remove the file.") from None
    except OSError as error:
        raise RigError(f"{folder} cannot be written to: {error.strerror}") from None
    return certificate_path, key_path


def application_uri(certificate: Path) -> str:
    """Return the application URI in a certificate. OPC UA compares it with the URI of the application."""
    try:
        names = _certificate(certificate).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        return names.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (x509.ExtensionNotFound, IndexError):
        raise RigError.of("rig.no-application", file=certificate) from None


def der(path: Path) -> bytes:
    """Return a certificate's bytes in DER."""
    return _certificate(path).public_bytes(Encoding.DER)


def read(path: Path) -> bytes:
    """Read a file; raise a RigError on failure."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise RigError(f"{path} cannot be read: {error.strerror}") from None


def secret(path: Path) -> bytes:
    """Read a file that only its owner may read."""
    content = read(path)
    if os.name == "posix" and path.stat().st_mode & OTHERS_MAY_READ:
        raise RigError(f"other users may read {path}", rule="only its owner may read it", remedy=f"chmod 600 {path}")
    return content


def _certificate(path: Path) -> x509.Certificate:
    content = read(path)
    try:
        load = x509.load_pem_x509_certificate if b"-----BEGIN" in content else x509.load_der_x509_certificate
        return load(content)
    except ValueError:
        raise RigError(f"{path} is not a certificate", rule="PEM or DER") from None


def _properties(content: bytes) -> CertProperties:
    return CertProperties(content, "pem" if b"-----BEGIN" in content else "der")


def _validator(peer: CertificateValidatorOptions) -> CertificateValidator:
    """Return a validator that checks the dates of a certificate and the OPC UA application that it names."""
    return CertificateValidator(CertificateValidatorOptions.BASIC_VALIDATION | peer)
