"""Intersection bundles: folders of plain data, shipped or the user's own.

A bundle is a folder with `map.json` and, where priors were fitted, `priors.npz` and
`bundle.toml`, which names the version of the layout and the checksum of every other file. Loading
one runs no code: JSON, TOML and plain arrays. A bundle of a newer layout, or one that was damaged
or changed by hand, is refused with the reason.

Shipped bundles lie beside this file. The user's own lie in the folder that the environment variable
SCENEWRIGHT_INTERSECTIONS names, else in the user's data folder (SCENEWRIGHT_DATA names another),
and come first.
"""

from __future__ import annotations

import hashlib
import os
import re
import tomllib
import unicodedata
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from scenewright.errors import InputError
from scenewright.files import find_env_folder
from scenewright.intersections.map_checks import find_map_fault
from scenewright.scene.map import IntersectionMap

FORMAT = 1
"""Version of the layout of a bundle's folder that this program writes, and the newest it reads."""
SHIPPED = "amsterdam_120"
"""The shipped bundle whose data fill in where another has none."""
REFINER_WEIGHTS = "refiner.safetensors"
"""The learned refiner's file in a bundle, where one was trained."""
_SHIPPED_ROOT = Path(__file__).parent
_MAX_TOML, _MAX_MAP = 1_000_000, 200_000_000
"""Bytes."""


def list_intersections() -> list[str]:
    """Names of every bundle that can be loaded, sorted."""
    return sorted({name for root in _list_roots() for name in _list_bundles(root)})


def list_shipped() -> list[str]:
    """Names of the bundles that come with the package."""
    return sorted(_list_bundles(_SHIPPED_ROOT))


def find_bundle_folder(name: str) -> Path:
    """The folder of a bundle; InputError, listing what exists, where there is none so named."""
    # The name is compared with what there is and never joined into a path.
    for root in _list_roots():
        if name in _list_bundles(root):
            return root / name
    shown = name if len(name) <= 40 else name[:37] + "..."
    raise InputError(f"no intersection {shown!r}; there are: {', '.join(list_intersections())}")


def ships_refiner(name: str) -> bool:
    """Whether a bundle holds a trained refiner; InputError where there is none so named."""
    return (find_bundle_folder(name) / REFINER_WEIGHTS).is_file()


def make_name(text: str) -> str:
    """The name that a user's own bundle gets of any text: "King's Cross" is `king-s-cross`.

    Letters lose their accents; a text without a Latin letter or digit is named by its hash.

    Raises:
        InputError: a shipped bundle has the name, or the text is empty.
    """
    plain = unicodedata.normalize("NFKD", text.casefold()).encode("ascii", "ignore").decode()
    name = re.sub(r"[^a-z0-9_]+", "-", plain)[:40].strip("-_")
    if not text.strip():
        raise InputError("an intersection needs a name")
    if not name:
        name = f"place-{hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"
    if name in list_shipped():
        raise InputError(f"{name!r} comes with scenewright; choose another name")
    return name


def find_custom_root() -> Path:
    """The folder of the user's own bundles; it need not exist where no variable names it."""
    return find_env_folder("SCENEWRIGHT_INTERSECTIONS") or find_data_folder() / "intersections"


def find_data_folder() -> Path:
    """The folder for the user's own data, which the variable SCENEWRIGHT_DATA names otherwise."""
    if (named := find_env_folder("SCENEWRIGHT_DATA")) is not None:
        return named
    from platformdirs import user_data_path  # only here, so that the command line starts faster

    return user_data_path("scenewright", appauthor=False)


def load_map(name: str) -> IntersectionMap:
    """The map of a bundle, read once per process; InputError where it is unknown or broken."""
    folder = find_bundle_folder(name)
    try:
        stat = (folder / "map.json").stat()
    except OSError as fault:
        raise InputError(f"cannot read the map of {name!r}: {fault.strerror}") from None
    return _parse_map(folder, stat.st_mtime_ns, stat.st_size)


def read_bundle_header(folder: Path) -> dict[str, Any]:
    """What `bundle.toml` says, {} where there is none.

    Raises:
        InputError: it is no TOML, or of a newer layout.
    """
    file = folder / "bundle.toml"
    if not file.is_file():
        return {}
    try:
        if file.stat().st_size > _MAX_TOML:
            raise InputError(f"bundle.toml of {folder.name!r} is too large to be one")
        header = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as fault:
        raise InputError(f"cannot read bundle.toml of {folder.name!r}: {fault}") from None
    version = header.get("format", 1)
    if not isinstance(version, int) or version < 1:
        raise InputError(f"bundle.toml of {folder.name!r} names no format: {version!r}")
    if version > FORMAT:
        raise InputError(
            f"intersection {folder.name!r} was written by a newer scenewright (format {version}, "
            f"this one reads up to {FORMAT}); update scenewright to use it"
        )
    return header


def check_bundle(folder: Path, *only: str) -> None:
    """Compare a bundle's files with their checksums.

    Args:
        only: names of the files to look at; all that bundle.toml lists if none is named.

    Raises:
        InputError: a file that is listed is missing or is not what it was.
    """
    sums = read_bundle_header(folder).get("sha256", {})
    if not isinstance(sums, dict):
        raise InputError(f"bundle.toml of {folder.name!r} lists no checksums")
    if any(name != Path(name).name for name in sums):
        raise InputError(f"bundle.toml of {folder.name!r} names a file outside of it")
    for name, wanted in sums.items():
        if only and name not in only:
            continue
        try:
            found = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        except OSError:
            raise InputError(f"{name} of {folder.name!r} is missing") from None
        if found != wanted:
            raise InputError(
                f"{name} of {folder.name!r} does not match its checksum: it was damaged or "
                "changed by hand"
            )


def sign_bundle(folder: Path, *names: str) -> None:
    """Update the checksums of files in the folder's bundle.toml, if it has one."""
    header = folder / "bundle.toml"
    if not header.is_file():
        return
    import tomli_w

    content = tomllib.loads(header.read_text(encoding="utf-8"))
    signed = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}
    content["sha256"] = {**content.get("sha256", {}), **signed}
    draft = header.with_name(header.name + ".part")
    draft.write_bytes(tomli_w.dumps(content).encode("utf-8"))
    os.replace(draft, header)


def _list_roots() -> list[Path]:
    return [find_custom_root(), _SHIPPED_ROOT]


def _list_bundles(root: Path) -> list[str]:
    """Names of the bundles in a folder; unfinished ones have a name with a dot."""
    try:
        names = os.listdir(root)
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as fault:
        raise InputError(f"cannot read {root}: {fault.strerror or fault}") from None
    return [n for n in names if not n.startswith(".") and (root / n / "map.json").is_file()]


@lru_cache(maxsize=16)
def _parse_map(folder: Path, _changed: int, size: int) -> IntersectionMap:
    """The map as it is now: a bundle may be written anew while a process lives."""
    check_bundle(folder, "map.json")
    try:
        if size > _MAX_MAP:
            raise InputError(f"the map of {folder.name!r} is too large to be one")
        found = IntersectionMap.model_validate_json((folder / "map.json").read_bytes())
    except (OSError, ValidationError) as fault:
        reason = str(fault).splitlines()[0]
        raise InputError(f"cannot read the map of {folder.name!r}: {reason}") from fault
    wrong = find_map_fault(found)
    if wrong is not None:
        raise InputError(f"the map of {folder.name!r} is none: {wrong}")
    return found
