"""Thousands of broken models: each must become a robot or a message, within a time, never a traceback.

    python benchmarks/mutated_robots.py --count 2000 --seed 1

It takes gymnasium's models, dm_control's and example-robot-data's, as far as these are installed, and breaks each in
one to three places: bytes, tags, attributes, numbers, included files. The same seed breaks the same places. A small
model that can still be read must also load as a problem, or say why not.

For speed MuJoCo reads them in the process that tries; where that dies or hangs, the file is tried once more as symphys
reads it, with MuJoCo in a process of its own.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import queue
import random
import re
import shutil
import sysconfig
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from mutations import EXTREMES, cut, flip, mutated, replacing

LONGEST, SHORT = 150.0, 30.0
"""[s] A model may take: MuJoCo's own limit and what comes after it; without a process of its own."""
MOST_BODIES = 6
"""Larger robots are read, and make no problem: that takes many seconds."""
SHARE = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix/share"
"""Where the meshes of example-robot-data are."""
SMALL = 200_000
"""[bytes] Larger models are left out: they take longer and break no other way."""
NUMBER = re.compile(rb'(?<=[" ])-?\d+\.?\d*(?:[eE][-+]?\d+)?(?=[" ])')
TAG = re.compile(rb"<[^>]*>")
ATTRIBUTE = re.compile(rb'([\w:]+)="([^"]*)"')
VALUES = (*EXTREMES, b"1,5", b"abc")
EXTRA = (
    b'<include file="/etc/passwd"/>', b'<include file="../../secret.xml"/>', b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;",
    b'<size memory="900T" njmax="999999999"/>', b'<composite type="cable" count="999999 1 1"/>', b"<![CDATA[", b"-->",
    b'<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>', b"<a>" * 300, b"\xff\xfe", b"\x00",
    b'<asset><mesh name="q" file="/dev/zero"/></asset>', b'<worldbody><body><freejoint/></body></worldbody>',
    b'<replicate count="9999999"><body/></replicate>', b'<asset><mesh name="e" vertex="0 0 0 1 1 1"/></asset>',
    b'<compiler meshdir="/etc" eulerseq="abc" angle="no"/>', b'<option timestep="-1" gravity="1 2"/>',
    b'<mimic joint="nothing"/>', b'<limit effort="-1" velocity="nan"/>', b"<inertial/>",
)  # fmt: skip


def models() -> list[Path]:
    """Models of installed packages."""
    found = list[Path]()
    for package, below in (("gymnasium", "envs/mujoco/assets"), ("dm_control", "suite")):
        spec = find_spec(package)
        if spec is not None and spec.submodule_search_locations:
            found += sorted((Path(next(iter(spec.submodule_search_locations))) / below).glob("*.xml"))
    return [path for path in (*found, *sorted(SHARE.rglob("*.urdf"))) if path.stat().st_size < SMALL]


TEXTUAL = (flip, cut, replacing(TAG, lambda *_: b""), replacing(TAG, lambda match, _: match[0] * 2))
MEANT = (
    replacing(ATTRIBUTE, lambda *_: b""),
    replacing(ATTRIBUTE, lambda match, dice: with_value(match, dice.choice(ATTRIBUTE.findall(match.string))[1])),
    replacing(NUMBER, lambda _, dice: dice.choice(VALUES)),
    replacing(ATTRIBUTE, lambda match, dice: with_value(match, dice.choice(VALUES))),
    replacing(TAG, lambda match, dice: match[0] + dice.choice(EXTRA)),
)
CHANGES = (*TEXTUAL, *MEANT, *MEANT)
"""Well-formed models get further."""


def with_value(attribute: re.Match[bytes], value: bytes) -> bytes:
    """The attribute with another value."""
    return attribute[1] + b'="' + value + b'"'


def cases(count: int, seed: int) -> Iterator[tuple[int, Path, bytes]]:
    """Which model, and its broken text."""
    dice, sources = random.Random(seed), models()
    if not sources:
        raise SystemExit("no models: pip install gymnasium dm_control example-robot-data")
    for number in range(count):
        path = dice.choice(sources)
        yield number, path, mutated(path.read_bytes(), dice, CHANGES)


def tried(path: Path) -> str:
    """What becomes of a file: "robot", "robot, refused as a problem", "message"; a traceback is told whole."""
    import symphys
    from symphys.errors import SymphysError

    try:
        robot = symphys.load_robot(path, self_collision=False, assets=[SHARE] if SHARE.is_dir() else [])
    except SymphysError as error:
        told = str(error).replace(str(path), "FILE")
        return f"message: {told}" if told.startswith("FILE: ") and "\n  File" not in told else f"odd message: {told}"
    try:
        robot.text()
        if len(robot.tables["body"]) <= MOST_BODIES:
            robot.problem()
    except SymphysError:
        return "robot, refused as a problem"
    return "robot"


def worker(inbox: multiprocessing.Queue[str], outbox: multiprocessing.Queue[str], direct: bool) -> None:
    """Try files until there is an empty name; ``direct``: MuJoCo reads them in this process, not in one of its own."""
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    if direct:
        from symphys.importing import source as isolated
        from symphys.importing.reading.child import main as read

        isolated.run = lambda folder, _: read(folder) or 0
    while path := inbox.get():
        try:
            outbox.put(tried(Path(path)))
        except BaseException:
            outbox.put(f"traceback: {traceback.format_exc()}")


class Trials:
    """A process that tries one file after another, and is replaced if it dies or takes too long."""

    def __init__(self, direct: bool) -> None:
        """``direct``: see ``worker``."""
        self.direct, self.longest = direct, SHORT if direct else LONGEST
        self.start()

    def start(self) -> None:
        """A fresh process."""
        context = multiprocessing.get_context("spawn")
        self.inbox, self.outbox = context.Queue(), context.Queue()
        self.process = context.Process(target=worker, args=(self.inbox, self.outbox, self.direct), daemon=self.direct)
        self.process.start()

    def __call__(self, path: Path) -> str:
        """What becomes of a file."""
        self.inbox.put(str(path))
        start = time.perf_counter()
        while time.perf_counter() - start < self.longest:
            try:
                return self.outbox.get(timeout=0.5)
            except queue.Empty:
                if not self.process.is_alive():
                    code = self.process.exitcode
                    self.start()
                    return f"crash: exit code {code}"
        self.process.kill()
        self.start()
        return f"hang: longer than {self.longest:g} s"


def main() -> None:
    """Try them all, and say what became of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--messages", action="store_true", help="print all")
    parser.add_argument("--only", type=int, help="one case, whose file is kept")
    options = parser.parse_args()
    found, slowest, bad = Counter[str](), 0.0, list[str]()
    start = time.perf_counter()
    quick, whole = Trials(direct=True), Trials(direct=False)
    with tempfile.TemporaryDirectory() as name:
        for number, path, text in cases(options.count, options.seed):
            if options.only is not None and number != options.only:
                continue
            folder = Path(name) / str(number)
            shutil.copytree(path.parent / "common", folder / "common") if (
                path.parent / "common"
            ).is_dir() else folder.mkdir()
            file = folder / path.name
            file.write_bytes(text)
            if options.only is not None:
                shutil.copy(file, path.name)
            before = time.perf_counter()
            outcome = quick(file)
            if outcome.startswith(("crash", "hang")):
                found[f"of these, {outcome.partition(':')[0]} of MuJoCo"] += 1
                print(f"{number} {path.name}: {outcome}, in a process of its own:", flush=True)
                outcome = whole(file)
                print(f"  {outcome}", flush=True)
            slowest = max(slowest, time.perf_counter() - before)
            kind = outcome.partition(":")[0]
            found[kind] += 1
            if options.messages:
                print(f"{number} {path.name}: {outcome}", flush=True)
            if kind in ("traceback", "hang", "crash", "odd message"):
                bad.append(f"{number} {path.name}: {outcome}")
                print(bad[-1], flush=True)
            shutil.rmtree(folder)
    whole.inbox.put("")
    for kind, count in found.most_common():
        print(f"{kind:<30} {count}")
    print(f"{number + 1} files, {time.perf_counter() - start:.0f} s, the slowest {slowest:.1f} s")
    raise SystemExit(1 if bad else 0)


if __name__ == "__main__":
    main()
