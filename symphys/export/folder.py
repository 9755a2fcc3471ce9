"""Write folders of exported files; a file that somebody else wrote or changed is never overwritten."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from symphys import files
from symphys.errors import SymphysError

LIST_FILE = "symphys-export.json"
"""Name of the file in each folder that lists the exported files with their SHA-256 sums."""

Files = Mapping[str, bytes]


class ExportError(SymphysError):
    """Raised for a problem that cannot be exported, or a file in the way."""


def write_folders(folders: Mapping[Path, Files]) -> list[Path]:
    """Write the files of all folders, each atomically; write none if a file is in the way.

    Returns:
        The paths of the files.

    Raises:
        ExportError: names the file that was not exported, or was changed since.
        FileError: a folder cannot be written.
    """
    for folder, contents in folders.items():
        known = _known(folder)
        for name, content in contents.items():
            _require_ours(folder / name, {*known.get(name, ()), _sum(content)})
    for folder, contents in folders.items():
        known = _known(folder)
        new = {name: [_sum(content)] for name, content in contents.items()}
        # both while files are replaced, so that an interrupted export can be done again
        both = {name: [*known.get(name, ()), *sums] for name, sums in new.items()}
        files.write_json(folder / LIST_FILE, {"files": known | both})
        for name, content in contents.items():
            files.write_bytes(folder / name, content)
        files.write_json(folder / LIST_FILE, {"files": known | new})
    return [folder / name for folder, contents in folders.items() for name in contents]


def _known(folder: Path) -> dict[str, list[str]]:
    path = folder / LIST_FILE
    if not path.exists():
        return {}
    content = files.read_json(path)
    listed = content.get("files") if isinstance(content, dict) else None
    if not isinstance(listed, dict) or not all(isinstance(sums, list) for sums in listed.values()):
        raise ExportError(f"{path} is not a list of exported files: remove it, or choose another folder")
    return listed


def _require_ours(path: Path, sums: set[str]) -> None:
    if not path.exists() and not path.is_symlink():
        return
    try:
        files.check_regular(path)
        ours = not path.is_symlink() and _sum(path.read_bytes()) in sums
    except OSError:
        ours = False
    if not ours:
        raise ExportError(f"{path} was not written by symphys, or was changed since: move it, or choose another folder")


def _sum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
