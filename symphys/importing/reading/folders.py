"""The files of a model that may be read, and the search for those that it names by package."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from symphys.importing.records import ImportProblem
from symphys.records import dataclass
from symphys.suggest import quote

PACKAGE = "package:"
MAX_PARENTS = 30
"""Number of parent folders that are searched for a package."""


@dataclass(frozen=True)
class Folders:
    """The folders whose files may be read: the model's own and those that the caller allows.

    Attributes:
        file: the model.
        assets: other folders that the caller allows.
    """

    file: Path
    assets: tuple[Path, ...] = ()

    @property
    def own(self) -> Path:
        """The folder of the model."""
        return self.file.parent

    def roots(self) -> set[Path]:
        """Return all allowed folders, with links resolved."""
        folders = {self.own, self.file.resolve().parent, *self.assets}
        return {folder.resolve() for folder in folders}

    def allows(self, path: Path) -> bool:
        """Whether a path lies in an allowed folder once links are followed."""
        found = path.resolve()
        return any(found.is_relative_to(root) for root in self.roots())

    def check(self, path: Path, named: str, what: str) -> None:
        """Refuse a path that leads out of the allowed folders.

        Args:
            path: of the file.
            named: as the model writes it.
            what: the element that names it.

        Raises:
            ImportProblem: it does.
        """
        if not self.allows(path):
            text = f"{what} names {quote(named, 200)}, which is outside of the model's folder; it is read only if its "
            raise ImportProblem(str(self.file), f"{text}folder is allowed: --assets {path.resolve().parent}")

    def mesh(self, named: str, folder: str = "") -> Path | None:
        """Return the file of a mesh of a URDF; None if there is none.

        ``package://name/rest`` is looked for below the folders above the model, the nearest first: in one that is
        called like the package, or that has the rest of the path, with or without its first parts. Of these, it must
        lie in an allowed folder, or in the package in which the model lies.

        Args:
            named: as the file writes it.
            folder: of meshes, as the file has it.

        Raises:
            ImportProblem: the file is there, and outside of the allowed folders.
        """
        if named.startswith(PACKAGE):
            return self.in_package(named)
        plain = named.removeprefix("file://")
        for path in (self.own / plain, self.own / folder / plain, self.own / folder / Path(plain).name):
            if exists(path):
                self.check(path, named, "a mesh")
                return path
        return next((path for base in self.assets if exists(path := base / Path(plain).name)), None)

    def in_package(self, named: str) -> Path | None:
        """Return the file of ``package://name/rest``; see ``mesh``."""
        parts = tuple(part for part in PurePosixPath(named.removeprefix(PACKAGE).lstrip("/")).parts if part != "/")
        outside = None
        for path, package in self.candidates(parts):
            if not exists(path):
                continue
            inside = package is not None and path.resolve().is_relative_to(package)
            if inside or self.allows(path):
                return path
            outside = outside or path
        if outside is not None:
            self.check(outside, named, "a mesh")
        return None

    def candidates(self, parts: tuple[str, ...]) -> Iterator[tuple[Path, Path | None]]:
        """Yield paths that a package's file may have, each with the package's folder if the model lies in it."""
        for base in self.assets:
            for start in range(len(parts)):
                yield base.joinpath(*parts[start:]), None
        own = self.own.resolve()
        for above in (own, *own.parents[:MAX_PARENTS]):
            if above.name == parts[0] if parts else False:
                yield above.joinpath(*parts[1:]), above
            if parts and own.is_relative_to(above / parts[0]):
                yield above.joinpath(*parts), above / parts[0]
            for start in range(len(parts) - 1):
                if start and own.is_relative_to(above / parts[start]):
                    yield above.joinpath(*parts[start:]), above / parts[start]
            yield above.joinpath(*parts), None


def exists(path: Path) -> bool:
    """Whether there is a file of that name, which may be no valid path."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
