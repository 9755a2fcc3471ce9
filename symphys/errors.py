"""Errors that a user may meet: every message says what is wrong, where, and what would be valid."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.records import dataclass


class SymphysError(Exception):
    """Something the user can mend: the command line prints the message and exits with code 2."""


class Unavailable(SymphysError):
    """Something that this machine lacks, such as a C compiler; says what to do. Elsewhere the same command may work."""


def install_advice(extra: str) -> str:
    """Return how to install an extra: symphys is on no package index, so pip needs the path of a checkout."""
    return f"pip install '.[{extra}]' in a checkout of symphys"


@dataclass(frozen=True)
class Issue:
    """One fault of a problem file.

    Attributes:
        where: table and key, as written in the file, for instance ``body[0].mass``; may be empty.
        message: what is wrong and what would be valid.
        file: where it is, if that is another file than the problem's: one that it includes.
    """

    where: str
    message: str
    file: str = ""

    def __str__(self) -> str:
        """Return ``where: message``."""
        return f"{self.where}: {self.message}" if self.where else self.message


class ProblemError(SymphysError):
    """A problem file that cannot be used; names the file and every fault found in it."""

    def __init__(self, file: str, issues: Sequence[Issue]) -> None:
        """Keep the file's name and its faults; the message lists the first ten."""
        self.file = file
        self.issues = tuple(issues)
        lines = [f"{issue.file or file}: {issue}" for issue in self.issues[:10]]
        if len(self.issues) > len(lines):
            lines.append(f"{file}: and {len(self.issues) - len(lines)} more")
        super().__init__("\n".join(lines))
