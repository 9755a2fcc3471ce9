"""Claims under random schedules: several processes, stopped and killed at every operation on files.

The holder of a run folder is the process whose token is in ``.claim``. Laws:

1. There is one holder at most.
2. A file is published by the holder only, at that very instant.
3. Who touches its claim in time, no two touches more than LEASE apart, and lives, keeps it until it releases it.
4. When all is over, the next process gets in.

Threads stand for processes. One runs at a time, until its next operation on files; which is chosen at random.
"""

from __future__ import annotations

import os
import random
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from symphys import files
from symphys.runs import claim as claims
from symphys.runs.claim import CLAIM_FOLDER, LEASE, FolderBusy, Owner, claimed

OPERATIONS = ("mkdir", "rename", "replace", "unlink", "rmdir", "listdir", "utime", "stat")
REAL = {name: getattr(os, name) for name in OPERATIONS}


class Died(BaseException):
    """Ends the thread of a process that was killed: no operation is done any more, whatever cleans up."""


@dataclass
class Actor:
    """A process; ``token``: of the claim that it made and has not released; ``touched``: when, by the clock."""

    world: World
    number: int
    machine: str
    token: str = ""
    touched: float = 0.0
    stood_still: bool = False
    alive: bool = True
    over: bool = False
    seen: dict[Path, tuple[int, float]] = field(default_factory=dict)
    go: threading.Lock = field(default_factory=threading.Lock)

    def run(self) -> None:
        """Claim, publish and release, a few times."""
        self.go.acquire()
        try:
            for _ in range(self.world.random.randint(2, 6)):
                try:
                    with claimed(self.world.folder) as claim:
                        for _ in range(self.world.random.randint(0, 2)):
                            claim.touch()
                            claim.publish("result.json", self.token.encode())
                except FolderBusy:
                    self.pause()
        except Died:
            pass
        except BaseException as error:
            self.world.faults.add(repr(error))
        self.over = True
        self.world.turn.release()

    def pause(self) -> None:
        """Wait for the next turn."""
        if self.alive:
            self.world.turn.release()
            self.go.acquire()
        if not self.alive:
            raise Died


@dataclass
class World:
    """A run folder, processes and a clock."""

    folder: Path
    random: random.Random
    clock: float = 0.0
    count: int = 0
    actors: list[Actor] = field(default_factory=list)
    faults: set[str] = field(default_factory=set)
    taken_over: int = 0
    turn: threading.Lock = field(default_factory=threading.Lock)

    @property
    def tokens(self) -> list[str]:
        """The claims that are there."""
        try:
            return REAL["listdir"](self.folder / CLAIM_FOLDER)
        except OSError:
            return []

    def run(self, deaths: float, stalls: float) -> None:
        """Let all processes run to their ends; probabilities of a death and of a long stall, each operation."""
        self.actors += [Actor(self, k, self.random.choice("abcde")) for k in range(self.random.randint(2, 4))]
        self.turn.acquire()
        threads = []
        for actor in self.actors:
            actor.go.acquire()
            threads.append(threading.Thread(target=actor.run, daemon=True))
            BY_THREAD[threads[-1]] = actor
            threads[-1].start()
        last = self.actors[0]
        while left := [actor for actor in self.actors if not actor.over]:
            if last.over or self.random.random() < 0.4:
                last = self.random.choice(left)
            self.clock += LEASE + 1 if self.random.random() < stalls else 0.001
            last.alive = last.alive and self.random.random() >= deaths
            last.go.release()
            self.turn.acquire()
            self.check()
        for thread in threads:
            thread.join()
            del BY_THREAD[thread]

    def check(self) -> None:
        """Laws 1 and 3."""
        held = self.tokens
        if len(held) > 1:
            self.faults.add(f"two holders: {held}")
        for actor in self.actors:
            actor.stood_still |= self.clock - actor.touched > LEASE
            if actor.token and actor.alive and not actor.over and not actor.stood_still and actor.token not in held:
                self.faults.add(f"{actor.token} lost its claim though it never stood still")

    def did(self, actor: Actor, name: str, arguments: tuple[Any, ...]) -> None:
        """Note what an operation of a process has done; law 2."""
        first = Path(arguments[0])
        second = Path(arguments[1]) if name in ("rename", "replace") else first
        if name == "rename" and second == self.folder / CLAIM_FOLDER:
            (actor.token,), actor.touched, actor.stood_still = self.tokens, self.clock, False
        if name == "rename" and first == self.folder / CLAIM_FOLDER / actor.token:
            actor.token = ""
        elif name == "rename" and first.parent == self.folder / CLAIM_FOLDER:
            self.taken_over += 1
        if name == "utime":
            actor.stood_still |= self.clock - actor.touched > LEASE
            actor.touched = self.clock
        if name == "replace" and self.tokens != [actor.token]:
            self.faults.add(f"{actor.token} published while the holder was {self.tokens}")


BY_THREAD: dict[threading.Thread, Actor] = {}


def current() -> Actor | None:
    """The process that runs; None outside."""
    return BY_THREAD.get(threading.current_thread())


def interrupted(name: str) -> Callable[..., Any]:
    """An operation before which its process may stand still or die."""

    def operation(*arguments: Any, **named: Any) -> Any:
        actor = current()
        if actor is None:
            return REAL[name](*arguments, **named)
        actor.pause()
        found = REAL[name](*arguments, **named)
        actor.world.did(actor, name, arguments)
        return found

    return operation


def put(path: Path, content: bytes) -> None:
    """Write a file, and stand still in its middle."""
    actor = current()
    if actor is None:
        path.write_bytes(content)
        return
    actor.pause()
    with path.open("wb") as file:
        actor.pause()
        file.write(content)


class SeenByEach:
    """What each process has seen of others' claims."""

    def get(self, path: Path) -> tuple[int, float] | None:
        actor = current()
        return actor.seen.get(path) if actor else None

    def __setitem__(self, path: Path, value: tuple[int, float]) -> None:
        if actor := current():
            actor.seen[path] = value


class NoHeart:
    """Processes touch their claims themselves here."""

    def add(self, claim: claims.Claim) -> None: ...
    def drop(self, claim: claims.Claim) -> None: ...


@pytest.fixture
def make_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], World]]:
    worlds: list[World] = []

    def myself() -> Owner:
        actor, world = current(), worlds[-1]
        world.count += 1
        number, machine = (actor.number, actor.machine) if actor else (-1, "later")
        return Owner("host", machine, number, "", f"token{world.count}")

    def alive(owner: Owner) -> bool:
        if actor := current():
            actor.pause()
        return worlds[-1].actors[owner.process].alive and not worlds[-1].actors[owner.process].over

    for name in OPERATIONS:
        monkeypatch.setattr(os, name, interrupted(name))
    monkeypatch.setattr(claims, "put", put)
    monkeypatch.setattr(claims, "seen", SeenByEach())
    monkeypatch.setattr(claims, "HEART", NoHeart())
    monkeypatch.setattr(claims, "myself", myself)
    monkeypatch.setattr(claims, "machine", lambda: actor.machine if (actor := current()) else "later")
    monkeypatch.setattr(claims.Owner, "alive", property(alive))
    monkeypatch.setattr(claims, "time", SimpleNamespace(monotonic=lambda: worlds[-1].clock, sleep=time.sleep))

    def make(seed: int) -> World:
        shutil.rmtree(tmp_path / "run", ignore_errors=True)
        files.make_folder(tmp_path / "run")
        worlds.append(World(tmp_path / "run", random.Random(seed)))
        return worlds[-1]

    yield make


def gets_in(world: World) -> bool:
    """Whether the next process, on a machine of its own, gets in after it has waited for two leases; law 4."""
    late = Actor(world, len(world.actors), "later", go=threading.Lock())
    for path in claims.occupied(world.folder):
        late.seen[path] = (path.lstat().st_mtime_ns, world.clock)
    world.clock += 2 * LEASE
    for path, (touched, since) in late.seen.items():
        assert touched == path.lstat().st_mtime_ns and world.clock - since > LEASE
        claims.evict(path)
    with claimed(world.folder) as claim:
        claims.clear(world.folder, claim)
    return {path.name for path in world.folder.iterdir()} <= {"result.json"}


def try_schedules(make_world: Callable[[int], World], seeds: range) -> None:
    """Processes that go on, that stand still, that are killed, and both."""
    taken_over = 0
    for seed in seeds:
        world = make_world(seed)
        world.run(deaths=(0.0, 0.03)[seed % 2], stalls=(0.0, 0.15)[seed // 2 % 2])
        assert not world.faults, f"seed {seed}: {world.faults}"
        assert gets_in(world), f"seed {seed}: {list(world.folder.iterdir())}"
        taken_over += world.taken_over
    assert taken_over > len(seeds) // 20, f"{taken_over}: else little was tried"


def test_there_is_one_holder_at_most_whoever_stands_still_or_dies(make_world: Callable[[int], World]) -> None:
    try_schedules(make_world, range(80))


@pytest.mark.thorough
def test_there_is_one_holder_at_most_in_a_hundred_thousand_schedules(make_world: Callable[[int], World]) -> None:
    try_schedules(make_world, range(1000, 101_000))
