"""Thousands of broken files: each is read or becomes a message, within a time and a memory, never a traceback.

    python benchmarks/mutated_files.py problem shipped recording run journal robot --count 1000 --seed 1

Problem files (one of all sorts, and those that are shipped), recordings (CSV and NPZ), run folders, their journals and
robots (URDF, MJCF) are broken in one to three places. The same seed breaks the same places. A process of its own tries
some thousand files at a time: one that dies, or takes longer than 10 s for a file, is reported with the number of the
file, and the next process goes on behind it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import random
import re
import resource
import shutil
import signal
import tempfile
import time
import traceback
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import mutated_robots
import numpy as np
from mutated_texts import MODELS, PROBLEM, RECORDED
from mutations import EXTREMES, cut, flip, mutated, replacing

LONGEST = 10
"""[s] of a processor for one file."""
MEMORY = 2 * 2**30
"""[bytes] of data that a process may have."""
BATCH = 2500
"""Files of one process: it takes seconds to start."""
NUMBER = re.compile(rb'(?<![\w"])-?\d+\.?\d*(?:[eE][-+]?\d+)?')
VALUES = (
    *EXTREMES, b"-1e308", b"1e150", b"1e100", b"1e-308", b"9223372036854775808", b"true", b'"x"', b"[]", b"{}",
    b"[1, 2]", b"[[1e308, -1e308]]", b"1_0", b"1979-05-27", b'"\\u0000"', b"null", b'"1e400"',
)  # fmt: skip
LINE = re.compile(rb"[^\n]*\n")
MEMBER = re.compile(rb'("[^"]*")(:)("[^"]*"|[^",{}]+)')
"""Name, colon and value of a member of a JSON object."""
SPOIL_NUMBER = replacing(NUMBER, lambda _, dice: dice.choice(VALUES))
CHANGES = (
    flip,
    cut,
    *[SPOIL_NUMBER] * 3,
    replacing(LINE, lambda match, dice: dice.choice(LINE.findall(match.string))),
    replacing(LINE, lambda *_: b""),
    replacing(LINE, lambda match, _: match[0] * 2),
)


def repacked(content: bytes, dice: random.Random) -> bytes:
    """An archive whose members are broken, not the archive around them."""
    written = io.BytesIO()
    methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2)
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(written, "w", dice.choice(methods)) as target:
        chosen = dice.choice(source.namelist())
        for name in source.namelist():
            member = source.read(name)
            if name == chosen:
                head = member.index(b"\n") + 1
                where = dice.choice(("head", "head", "all", "shape"))
                if where == "head":
                    member = mutated(member[:head], dice, (flip, SPOIL_NUMBER)) + member[head:]
                elif where == "shape":
                    wild = dice.choice((b"(10000000000000000000000000000000,)", b"(-1,)", b"()", b"(4, 0)", b"(2, 2)"))
                    member = re.sub(rb"\([\d, ]*\)", wild, member[:head]) + member[head:]
                else:
                    member = mutated(member, dice, (flip, cut))
            target.writestr(name, member)
    return written.getvalue()


def archive(**arrays: Any) -> bytes:
    """The content of an NPZ file."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


class Problems:
    """Problem files: loaded, and their world made."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        self.file = folder / "problem.toml"

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        from symphys.problem import load_problem

        self.file.write_bytes(mutated(PROBLEM.encode(), dice, CHANGES))
        load_problem(self.file).world()


class ShippedProblems:
    """The problem files of the package, beside the files that they include."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a copy of their folder."""
        import symphys.problems

        self.folder = folder / "problems"
        shutil.copytree(Path(symphys.problems.__path__[0]), self.folder)
        self.texts = [path.read_bytes() for path in sorted(self.folder.glob("*.toml"))]

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        from symphys.problem import load_problem

        file = self.folder / "broken.toml"
        file.write_bytes(mutated(dice.choice(self.texts), dice, CHANGES))
        load_problem(file).world()


class Recordings:
    """Recordings beside a problem file, as CSV or NPZ."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        self.folder = folder
        rows = np.linspace(0, 0.4, 5)
        self.arrays = archive(time=rows, z=1 - rows, other=np.ones((5, 2)))
        lines = ["time,z,other", *(f"{t:.2f},{1 - t:.3f},1" for t in rows)]
        self.text = ("\n".join(lines) + "\n").encode()

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        from symphys.problem import load_problem

        kind = dice.choice(("csv", "npz", "npz packed"))
        name = "a." + kind[:3]
        if kind == "csv":
            content = mutated(self.text, dice, CHANGES)
        else:
            content = mutated(self.arrays, dice, (flip, cut)) if kind == "npz" else repacked(self.arrays, dice)
        (self.folder / name).write_bytes(content)
        file = self.folder / "problem.toml"
        file.write_text(RECORDED.replace("FILE", name))
        load_problem(file)


def solved(folder: Path) -> Path:
    """Solve the problem of all sorts below a folder, and return the folder of the run."""
    import symphys

    file = folder / "all.toml"
    file.write_text(PROBLEM)
    symphys.solve(file, "gradient", folder=folder / "out", backend="casadi", iterations=2)
    (result,) = folder.rglob("result.json")
    return result.parent


def list_runs(root: Path) -> None:
    """List the runs below a folder, and the best of them, as the command line does."""
    from symphys.cli.best import best
    from symphys.cli.ls import ls

    with contextlib.redirect_stdout(io.StringIO()):
        for command in (ls, best):
            command.main([str(root)], standalone_mode=False)


class Runs:
    """Run folders: one of their files is broken; the run is read, listed and its page made."""

    def __init__(self, folder: Path) -> None:
        """Solve one problem."""
        self.root, self.folder = folder / "out", solved(folder)
        kinds = (".json", ".npz", ".csv", ".toml", ".jsonl")
        self.files = {path: path.read_bytes() for path in sorted(self.folder.iterdir()) if path.suffix in kinds}
        self.broken = next(iter(self.files))

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        import symphys
        from symphys.report.pages.run import write_light_report
        from symphys.results.discovery import read_all

        self.broken.write_bytes(self.files[self.broken])
        self.broken = dice.choice([*self.files])
        content = self.files[self.broken]
        if self.broken.suffix != ".npz":
            content = mutated(content, dice, CHANGES)
        else:
            content = repacked(content, dice) if dice.random() < 0.7 else mutated(content, dice, (flip, cut))
        self.broken.write_bytes(content)
        read_all(self.root)
        symphys.results.runs(self.root)
        list_runs(self.root)
        write_light_report(self.folder)


class Journals:
    """Journals of run folders, most of whose broken lines have a right checksum: the runs are listed."""

    def __init__(self, folder: Path) -> None:
        """Solve one problem."""
        from symphys.results.table.journal import NAME

        solved(folder)
        self.root = folder / "out"
        self.journal = self.root / NAME
        self.line = self.journal.read_bytes()

    def __call__(self, dice: random.Random) -> None:
        """List one."""
        from symphys.results.table.journal import BODY, MARK

        body = mutated(self.line[BODY:].rstrip(b"\n"), dice, (*CHANGES, replacing(MEMBER, spoilt_member)))
        checksum = zlib.crc32(body) if dice.random() < 0.9 else dice.randrange(2**32)
        lines = [MARK + b'%08x",' % checksum + body + b"\n", self.line]
        self.journal.write_bytes(b"".join(dice.sample(lines, dice.choice((1, 2)))))
        list_runs(self.root)


def spoilt_member(match: re.Match[bytes], dice: random.Random) -> bytes:
    """A member of a JSON object with another name, or with another value."""
    if dice.random() < 0.2:
        return dice.choice((b'"run"', b'"fault"', b'"solved"', b'"\\u001b[2J"')) + match[2] + match[3]
    return match[1] + match[2] + (dice.choice((*VALUES, b'"\\u001b[2J"', b"false", b'"solved"')) or b"null")


class Robots:
    """Small robots as URDF and MJCF, read in this process, and as problems."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        from symphys.importing import source as isolated
        from symphys.importing.reading.child import main as read

        isolated.run = lambda place, _: read(place) or 0  # type: ignore[assignment]
        self.folder = folder

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        import symphys

        name = dice.choice(sorted(MODELS))
        (self.folder / name).write_bytes(mutated(MODELS[name], dice, mutated_robots.CHANGES))
        robot = symphys.load_robot(self.folder / name, self_collision=False)
        robot.text()
        robot.problem()


KINDS: dict[str, Callable[[Path], Callable[[random.Random], None]]] = {
    "problem": Problems,
    "shipped": ShippedProblems,
    "recording": Recordings,
    "run": Runs,
    "journal": Journals,
    "robot": Robots,
}


def outcome(attempt: Callable[[random.Random], None], kind: str, number: int) -> str:
    """What becomes of one file: read, message, or the traceback."""
    from symphys.errors import SymphysError

    def late(*_: object) -> None:
        raise TimeoutError(f"longer than {LONGEST} s")

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        attempt(random.Random(f"{kind} {number}"))
    except SymphysError:
        return "message"
    except BaseException:
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "read"


def work(pipe: Connection, kind: str, numbers: range) -> None:
    """Try files, and send what became of each."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    if kind == "recording":  # it takes half of the time, and is the same for all
        from symphys.problem import load

        load.check_overlap = lambda *_: None
    with tempfile.TemporaryDirectory() as name:
        attempt = KINDS[kind](Path(name))
        outcome(attempt, kind, 0)  # imports what is imported late
        for number in numbers:
            pipe.send(outcome(attempt, kind, number))
    pipe.close()


def tried(kind: str, first: int, last: int) -> Counter[str]:
    """What became of the files from ``first`` to ``last``; what is bad is printed."""
    context, found = multiprocessing.get_context("spawn"), Counter[str]()
    while first < last:
        ours, theirs = context.Pipe(duplex=False)
        numbers = range(first, min(first + BATCH, last))
        process = context.Process(target=work, args=(theirs, kind, numbers), daemon=True)
        process.start()
        theirs.close()
        try:
            for number in numbers:
                if not ours.poll(20 * LONGEST):
                    raise EOFError
                said = ours.recv()
                first = number + 1
                found[said if said in ("read", "message") else "bad"] += 1
                if said not in ("read", "message"):
                    print(f"{kind} {number}:\n{said}", flush=True)
        except EOFError:
            process.kill()
            print(f"{kind} {first}: the process died or hung", flush=True)
            found["bad"] += 1
            first += 1
        process.join()
    return found


def main() -> None:
    """Try them all, and say what became of them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kinds", nargs="*", default=sorted(KINDS))
    parser.add_argument("--count", type=int, default=1000, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    bad = 0
    for kind in options.kinds:
        start = time.perf_counter()
        first = options.seed * 10**7
        found = tried(kind, first, first + options.count)
        bad += found["bad"]
        rest = ", ".join(f"{count} {what}" for what, count in sorted(found.items()))
        print(f"{kind}: {rest}; {time.perf_counter() - start:.0f} s", flush=True)
    raise SystemExit(1 if bad else 0)


if __name__ == "__main__":
    main()
