"""An engine whose drivers are threads of this process, for tests of what follows drivers."""

from __future__ import annotations

import threading

from symphys.batches.engines.driver import DriverTask, drive
from symphys.files import FileError


class Threads:
    """An engine whose drivers are threads of this process; ``stillborn``: how many end before they do anything."""

    def __init__(self, stillborn: int = 0) -> None:
        self.stillborn, self.started = stillborn, 0
        self.drivers: list[threading.Thread] = []
        self.heard: list[str] = []
        self.closed = False

    def start(self, task: DriverTask) -> None:
        self.started += 1
        self.drivers.append(threading.Thread(target=self.work, args=(task, self.started <= self.stillborn)))
        self.drivers[-1].start()

    def work(self, task: DriverTask, stillborn: bool) -> None:
        if stillborn:
            self.heard.append("it was born dead")
            return
        try:
            drive(task)
        except FileError as error:
            self.heard.append(str(error))

    def poll(self) -> tuple[int, list[str]]:
        found, self.heard = self.heard, []
        return sum(each.is_alive() for each in self.drivers), found

    def close(self) -> None:
        for each in self.drivers:
            each.join()
        self.closed = True
