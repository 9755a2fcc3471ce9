"""Thousands of broken files: each is read or becomes a message, within a time and a memory, never a traceback.

    python benchmarks/mutated_files.py problem recording run robot --count 1000 --seed 1

Problem files, recordings (CSV and NPZ), run folders and robots (URDF, MJCF) are broken in one to three places. The same
seed breaks the same places. A process of its own tries a hundred files at a time: one that dies, or takes longer than
10 s for a file, is reported with the number of the file, and the next process goes on behind it.
"""

from __future__ import annotations

import argparse
import io
import multiprocessing
import random
import re
import resource
import signal
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from mutated_texts import MODELS, PROBLEM, RECORDED

LONGEST = 10
"""[s] of a processor for one file."""
MEMORY = 2 * 2**30
"""[bytes] of data that a process may have."""
BATCH = 100
NUMBER = re.compile(rb'(?<![\w"])-?\d+\.?\d*(?:[eE][-+]?\d+)?')
LINE = re.compile(rb"[^\n]*\n")
VALUES = (
    b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e150", b"1e100", b"-1", b"0", b"1e30", b"1e-30", b"1e-308",
    b"999999999", b"9223372036854775808", b"-0.0", b"true", b'"x"', b"[]", b"{}", b"[1, 2]", b"[[1e308, -1e308]]",
    b"", b"1_0", b"0x10", b"1e8", b"99999", b"9" * 400, b"1979-05-27", b'"\\u0000"', b"null", b'"1e400"',
)  # fmt: skip


def flip(text: bytes, dice: random.Random) -> bytes:
    """Another byte at one place."""
    place = dice.randrange(len(text))
    return text[:place] + bytes([dice.randrange(256)]) + text[place + 1 :]


def cut(text: bytes, dice: random.Random) -> bytes:
    """Without a piece, or without the end."""
    place = dice.randrange(len(text))
    return text[:place] + (b"" if dice.random() < 0.3 else text[place + dice.randrange(1, 60) :])


def spoil_number(text: bytes, dice: random.Random) -> bytes:
    """Another value in place of a number."""
    return changed(text, dice, NUMBER, lambda _: dice.choice(VALUES))


def swap_lines(text: bytes, dice: random.Random) -> bytes:
    """One line with what another has."""
    other = dice.choice(LINE.findall(text) or [b"\n"])
    return changed(text, dice, LINE, lambda _: other)


def lose_line(text: bytes, dice: random.Random) -> bytes:
    """Without one line."""
    return changed(text, dice, LINE, lambda _: b"")


def double_line(text: bytes, dice: random.Random) -> bytes:
    """With one line twice."""
    return changed(text, dice, LINE, lambda match: match[0] * 2)


def changed(
    text: bytes, dice: random.Random, what: re.Pattern[bytes], change: Callable[[re.Match[bytes]], bytes]
) -> bytes:
    """The text with one match changed."""
    found = list(what.finditer(text))
    if not found:
        return text
    match = dice.choice(found)
    return text[: match.start()] + change(match) + text[match.end() :]


CHANGES = (flip, cut, spoil_number, spoil_number, spoil_number, swap_lines, lose_line, double_line)


def mutated(text: bytes, dice: random.Random, changes: Any = CHANGES) -> bytes:
    """A text broken in one to three places."""
    for _ in range(dice.choice((1, 1, 2, 3))):
        text = dice.choice(changes)(text, dice) or b" "
    return text


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
                    member = mutated(member[:head], dice, (flip, spoil_number)) + member[head:]
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

        self.file.write_bytes(mutated(PROBLEM.encode(), dice))
        load_problem(self.file).world()


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
            content = mutated(self.text, dice)
        else:
            content = mutated(self.arrays, dice, (flip, cut)) if kind == "npz" else repacked(self.arrays, dice)
        (self.folder / name).write_bytes(content)
        file = self.folder / "problem.toml"
        file.write_text(RECORDED.replace("FILE", name))
        load_problem(file)


class Runs:
    """Run folders: one of their files is broken; the run is read, listed and its page made."""

    def __init__(self, folder: Path) -> None:
        """Solve one problem."""
        import symphys

        file = folder / "all.toml"
        file.write_text(PROBLEM)
        symphys.solve(file, "gradient", folder=folder / "out", backend="casadi", iterations=2)
        (result,) = folder.rglob("result.json")
        self.root, self.folder = folder / "out", result.parent
        self.files = {path: path.read_bytes() for path in sorted(self.folder.iterdir()) if path.is_file()}

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        import symphys
        from symphys.report.pages.run import write_light_report
        from symphys.results.discovery import read_all

        chosen = dice.choice(
            [path for path in self.files if path.suffix in (".json", ".npz", ".csv", ".toml", ".jsonl")]
        )
        for path, content in self.files.items():
            if path == chosen:
                packed = path.suffix == ".npz" and dice.random() < 0.7
                content = repacked(content, dice) if packed else mutated(content, dice)
            path.write_bytes(content)
        read_all(self.root)
        list(symphys.results(self.root))
        write_light_report(self.folder)


class Robots:
    """Small robots as URDF and MJCF, read in this process, and as problems."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        from symphys.importing.reading import isolated
        from symphys.importing.reading.child import main as read

        isolated.run = lambda place, _: read(place) or 0  # type: ignore[assignment]
        self.folder = folder

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        import mutated_robots

        import symphys

        name = dice.choice(sorted(MODELS))
        (self.folder / name).write_bytes(mutated_robots.mutated(MODELS[name], dice))
        robot = symphys.load_robot(self.folder / name, self_collision=False)
        robot.text()
        robot.problem()


KINDS: dict[str, Callable[[Path], Callable[[random.Random], None]]] = {
    "problem": Problems,
    "recording": Recordings,
    "run": Runs,
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
