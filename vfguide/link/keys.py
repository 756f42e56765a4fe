"""Key pairs of a formation's members, and the roster of public keys.

The roster lies beside the mission and is no secret. A private key is a file of its own (PEM, PKCS 8) that
only its owner may read. It is unencrypted, since a daemon has nobody to ask for a pass phrase.
"""

import os
import secrets
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Protocol

import yaml

from vfguide.errors import InputError
from vfguide.regular_file import open_regular, read_by_others, replace_file

# The functions below import `cryptography` themselves: it takes 7 MB, and a formation without keys lacks it.
if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

PUBLIC_SIZE = 32
"""Size of a public key, bytes."""

LARGEST_ROSTER = 256 * 1024
LARGEST_KEY = 4096
"""Maximum sizes of a roster and a key file, bytes: a larger file is something else."""

RADIO_KEY, RADIO_KEY_SIZE = "radio.psk", 32
"""Name and size, bytes, of the file with the key that all members share on a radio, in hexadecimal digits."""

OPERATOR = "operator"
"""Name of the key pair for watching and ordering, made along with the vehicles'."""

HEADING = (
    "# Public keys of a formation, made by `vfguide keys make`."
    " Not secret: everybody gets the same file.\n"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Roster:
    """Public keys of a formation by name."""

    formation: str
    vehicles: Mapping[str, bytes] = field(default_factory=dict)
    """Public keys by vehicle name, 32 bytes each."""
    operators: Mapping[str, bytes] = field(default_factory=dict)
    """Public keys by name of the operators, who watch and order, 32 bytes each."""

    def public(self, name: str) -> bytes | None:
        """Return the public key of a member; None for a stranger."""
        return self.vehicles.get(name) or self.operators.get(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyPlaces:
    """Paths of a mission's keys: `NAME.roster` and the directory `NAME.keys` beside `NAME.yaml`."""

    roster: Path
    directory: Path
    """Directory of private keys, one file each."""

    def private(self, name: str) -> Path:
        """Return the path of a member's private key."""
        return self.directory / f"{name}.key"

    @property
    def radio(self) -> Path:
        """Path of the radio key, which all members share."""
        return self.directory / RADIO_KEY


def key_places(mission: Path) -> KeyPlaces:
    """Return the paths of a mission file's keys.

    Raises:
        InputError: the path names no file.
    """
    if not mission.name:
        raise InputError(
            f"keys: {str(mission)!r} is no file; name the mission file they stand beside"
        )
    return KeyPlaces(roster=mission.with_suffix(".roster"), directory=mission.with_suffix(".keys"))


def public_bytes(key: "Ed25519PrivateKey") -> bytes:
    """Return the public half of a key pair, 32 bytes."""
    return key.public_key().public_bytes_raw()


class Verifier(Protocol):
    """Function that verifies signatures by one key."""

    def __call__(self, signature: bytes, signed: bytes) -> bool:
        """Check whether the key's owner has signed these bytes."""


def verifier_of(public: bytes) -> Verifier:
    """Return a verifier for a public key of 32 bytes; raise ValueError if the bytes are no key."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    key = Ed25519PublicKey.from_public_bytes(public)

    def verifies(signature: bytes, signed: bytes) -> bool:
        try:
            key.verify(signature, signed)
        except InvalidSignature:
            return False
        return True

    return verifies


def read_private_key(
    path: Path, environment: Mapping[str, str] = os.environ
) -> "Ed25519PrivateKey":
    """Read a private key; raise InputError if it is unreadable, no Ed25519 key, or open to others."""
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    content = read_secret(path, "private key", environment)
    try:
        key = load_pem_private_key(content, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        key = None
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"{path}: is no private Ed25519 key in PEM form; see `vfguide keys make`")
    return key


def read_radio_key(path: Path, environment: Mapping[str, str] = os.environ) -> bytes:
    """Read a radio key, 32 bytes; raise InputError if it is unreadable, no radio key, or open to others."""
    content = read_secret(path, "radio key", environment)
    try:
        key = bytes.fromhex(content.decode("ascii"))
    except ValueError:
        key = b""
    if len(key) != RADIO_KEY_SIZE:
        raise InputError(
            f"{path}: is no radio key of {2 * RADIO_KEY_SIZE} hexadecimal digits; see `vfguide keys make`"
        )
    return key


@contextmanager
def _readable(path: Path, what: str) -> Iterator[BinaryIO]:
    """Open a key file or roster for reading; raise InputError if it cannot be read."""
    try:
        with open_regular(path) as stream:
            yield stream
    except OSError as error:
        raise InputError(
            f"{path}: the {what} cannot be read ({error.strerror}); make keys with `vfguide keys make`"
        ) from None


def read_secret(path: Path, what: str, environment: Mapping[str, str]) -> bytes:
    """Read a file that only its owner may read, up to just over `LARGEST_KEY` bytes.

    Args:
        path: path of the file.
        what: name of the content for error messages.
        environment: environment variables; they name systemd's directory of credentials.

    Raises:
        InputError: it cannot be read, or others may read it.
    """
    with _readable(path, what) as stream:
        found = os.fstat(stream.fileno())
        content = stream.read(LARGEST_KEY + 1)
    # systemd protects this directory by an access list, which shows as permissions of the group.
    credentials = environment.get("CREDENTIALS_DIRECTORY")
    kept_by_systemd = bool(credentials) and path.parent == Path(credentials or "")
    if not kept_by_systemd:
        if read_by_others(found):
            raise InputError(f"{path}: others may read this {what}; run: chmod 600 {path}")
        if hasattr(os, "geteuid") and found.st_uid not in {os.geteuid(), 0}:
            raise InputError(
                f"{path}: this {what} belongs to another user; run: chown {os.geteuid()} {path}"
            )
    return content


def write_private_key(path: Path, key: "Ed25519PrivateKey") -> None:
    """Write a private key to a file that only its owner may read, replacing any earlier key."""
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    write_secret(path, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))


def make_radio_key(places: KeyPlaces, *, anew: bool = False) -> bool:
    """Make the radio key if it is missing, or in any case with `anew`; return whether it was made."""
    if places.radio.exists() and not anew:
        return False
    write_secret(places.radio, secrets.token_hex(RADIO_KEY_SIZE).encode() + b"\n")
    return True


def write_secret(path: Path, content: bytes) -> None:
    """Write a file that only its owner may read, replacing any earlier file."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    replace_file(path, content, mode=0o600)


def read_revocations(path: Path) -> tuple[bytes, ...]:
    """Read statements about revoked keys, one per line, empty if damaged; none without a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        with open_regular(path) as stream:
            lines = stream.read(LARGEST_ROSTER).splitlines()
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise InputError(
            f"{path}: what is known of revoked keys cannot be read ({error.strerror}); mend or remove it"
        ) from None
    sound = (len(line) % 2 == 0 and not line.strip(b"0123456789abcdef") for line in lines)
    return tuple(
        bytes.fromhex(line.decode()) if is_sound else b""
        for line, is_sound in zip(lines, sound, strict=True)
    )


def write_revocations(path: Path, statements: Iterable[bytes]) -> None:
    """Write statements about revoked keys to a file, replacing any earlier file."""
    write_secret(path, b"".join(one.hex().encode() + b"\n" for one in statements))


def read_roster(path: Path) -> Roster:
    """Read a roster; raise InputError if the file cannot be read or is none."""
    with _readable(path, "roster") as stream:
        content = stream.read(LARGEST_ROSTER + 1)
    if len(content) > LARGEST_ROSTER:
        raise InputError(f"{path}: is too long for a roster")
    try:
        data = yaml.safe_load(content)
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError):
        raise InputError(f"{path}: is no YAML; see `vfguide keys make`") from None
    if not isinstance(data, dict) or not isinstance(data.get("formation"), str):
        raise InputError(f"{path}: formation: is missing; see `vfguide keys make`")
    strange = set(data) - {"formation", "vehicles", "operators"}
    if strange:
        raise InputError(
            f"{path}: {min(map(str, strange))}: is not known; there are formation, vehicles, operators"
        )
    roster = Roster(
        formation=data["formation"],
        vehicles=_public_keys(path, "vehicles", data.get("vehicles")),
        operators=_public_keys(path, "operators", data.get("operators")),
    )
    both = set(roster.vehicles) & set(roster.operators)
    if both:
        raise InputError(f"{path}: {min(both)}: is a vehicle and an operator; rename one of them")
    keys = [*roster.vehicles.values(), *roster.operators.values()]
    if len(set(keys)) < len(keys):
        raise InputError(f"{path}: two members have the same key; run `vfguide keys rotate`")
    return roster


def _public_keys(path: Path, group: str, found: object) -> dict[str, bytes]:
    """Decode a group of public keys by name from a roster; raise InputError if one is invalid."""
    if found is None:
        return {}
    if not isinstance(found, dict):
        raise InputError(f"{path}: {group}: holds no names with their keys")
    keys: dict[str, bytes] = {}
    for name, text in found.items():
        try:
            key = bytes.fromhex(text) if isinstance(text, str) else b""
            if len(key) == PUBLIC_SIZE:
                verifier_of(key)
        except ValueError:
            key = b""
        if not isinstance(name, str) or len(key) != PUBLIC_SIZE:
            raise InputError(
                f"{path}: {group}: {name}: is no public key of {2 * PUBLIC_SIZE} hexadecimal digits in quotes"
            )
        keys[name] = key
    return keys


def write_roster(path: Path, roster: Roster) -> None:
    """Write a roster to a file."""
    content = {
        "formation": roster.formation,
        "vehicles": {name: key.hex() for name, key in roster.vehicles.items()},
        "operators": {name: key.hex() for name, key in roster.operators.items()},
    }
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_style=None)
    replace_file(path, (HEADING + text).encode())


def make_keys(
    places: KeyPlaces,
    formation: str,
    vehicles: Collection[str],
    *,
    operators: Collection[str] = (OPERATOR,),
    anew: Collection[str] = (),
) -> list[str]:
    """Make the missing key pairs and those to be replaced, and write the roster.

    Args:
        places: paths of the keys.
        formation: name of the formation.
        vehicles: names of all its vehicles; the roster keeps no others.
        operators: names of operators, in addition to those that the roster has.
        anew: names whose keys are replaced.

    Returns:
        Names of the members with a new key, in order.

    Raises:
        InputError: the roster cannot be read, or belongs to another formation.
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    known = read_roster(places.roster) if places.roster.exists() else Roster(formation=formation)
    if known.formation != formation:
        raise InputError(
            f"{places.roster}: belongs to {known.formation!r}; move it away, or rename the mission's file"
        )
    made: list[str] = []

    def key_of(name: str) -> bytes:
        before = known.public(name)
        if before is not None and name not in anew:
            return before
        key = Ed25519PrivateKey.generate()
        write_private_key(places.private(name), key)
        made.append(name)
        return public_bytes(key)

    roster = Roster(
        formation=formation,
        vehicles={name: key_of(name) for name in vehicles},
        operators={name: key_of(name) for name in dict.fromkeys([*known.operators, *operators])},
    )
    write_roster(places.roster, roster)
    return made
