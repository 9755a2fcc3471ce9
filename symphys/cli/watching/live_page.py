"""A page of a batch while it is solved: objective and errors of every run, in a browser on this machine.

A server on 127.0.0.1 answers one page, the state of the batch, and the finished report below its folder. It refuses
requests that name another host, so that no page of the web can read it, and ends with the command.
"""

from __future__ import annotations

import json
import mimetypes
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from symphys import files
from symphys.batches import Observer

if TYPE_CHECKING:
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow

HOST = "127.0.0.1"
MOST_ROWS = 400
"""Iterations of a run that are kept: every other one is dropped where there are more."""
MOST_RUNS = 60
"""Runs whose curves are kept."""
PATIENCE = 4.0
"""[s] that the server stays for browsers that show the report."""
LINGER = 1.0
"""[s] that it stays after the last request for the report."""
REPORT = "/report/"


class LiveRun:
    """The iterations of a run so far: seconds, objective and largest error / tolerance."""

    def __init__(self, name: str) -> None:
        """Begin without iterations."""
        self.name, self.words = name, "begins"
        self.rows: list[tuple[float, float, float]] = []
        self._every, self._seen = 1, 0

    def add(self, row: TraceRow) -> None:
        """Take note of an iteration."""
        self._seen += 1
        if self._seen % self._every == 0:
            self.rows.append((row.seconds, row.objective, row.max_violation))
        if len(self.rows) >= MOST_ROWS:
            self.rows, self._every = self.rows[::2], 2 * self._every

    def to_json(self) -> dict[str, Any]:
        """Return what the page shows."""
        names = ("seconds", "objective", "worst")
        columns = zip(*self.rows, strict=True) if self.rows else ((), (), ())
        return {"name": self.name, "words": self.words, **dict(zip(names, map(list, columns), strict=True))}


class LivePage(Observer):
    """An observer that passes all on to another one, and serves what it knows.

    Attributes:
        address: of the page.
    """

    def __init__(self, shown: Observer, out: Path) -> None:
        """Start the server; ``out``: the folder of the batch, whose report it serves in the end."""
        self._shown, self._out = shown, out.resolve()
        self._runs: dict[str, LiveRun] = {}
        self._note, self._done, self._fetched = "", "", 0.0
        self._server = ThreadingHTTPServer((HOST, 0), self._handler())
        self._server.daemon_threads = True
        self.address = f"http://{HOST}:{self._server.server_port}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def started(self, job: Job, resumed: bool) -> None:
        """Implement ``Observer.started``."""
        self._shown.started(job, resumed)
        if len(self._runs) < MOST_RUNS:
            self._runs[job.name] = LiveRun(job.name)

    def advanced(self, job: Job, row: TraceRow) -> None:
        """Implement ``Observer.advanced``."""
        self._shown.advanced(job, row)
        if run := self._runs.get(job.name):
            run.words = f"iteration {row.iteration}"
            run.add(row)

    def judging(self, job: Job, what: str) -> None:
        """Implement ``Observer.judging``."""
        self._shown.judging(job, what)
        if run := self._runs.get(job.name):
            run.words = what

    def ended(self, job: Job, result: Result, skipped: bool) -> None:
        """Implement ``Observer.ended``."""
        self._shown.ended(job, result, skipped)
        if run := self._runs.get(job.name):
            run.words = result.verdict.replace("_", " ")

    def note(self, text: str) -> None:
        """Implement ``Observer.note``."""
        self._shown.note(text)
        self._note = text

    def close(self, page: Path | None) -> None:
        """Let browsers go on to the report, if there is one, and end."""
        if page is not None and page.resolve().is_relative_to(self._out):
            self._done = REPORT + page.resolve().relative_to(self._out).as_posix()
            until = monotonic() + PATIENCE
            while monotonic() < (self._fetched + LINGER if self._fetched else until):
                sleep(0.05)
        self._server.shutdown()
        self._server.server_close()

    def state(self) -> dict[str, Any]:
        """Return what the page asks for."""
        runs = [run.to_json() for run in list(self._runs.values())]
        return {"runs": runs, "note": self._note, "done": self._done}

    def answer(self, path: str) -> tuple[str, bytes] | None:
        """Return the kind and the content of what is asked for; None where there is no such thing."""
        from symphys.report.pages.live import live_page

        if path == "/":
            return "text/html; charset=utf-8", live_page().encode()
        if path == "/state":
            return "application/json", json.dumps(files.strict(self.state()), allow_nan=False).encode()
        if not path.startswith(REPORT) or not self._done:
            return None
        wanted = (self._out / unquote(path.removeprefix(REPORT))).resolve()
        if not wanted.is_relative_to(self._out) or wanted.suffix not in (".html", ".js") or not wanted.is_file():
            return None
        self._fetched = monotonic()
        return mimetypes.guess_type(wanted.name)[0] or "text/plain", wanted.read_bytes()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        page = self

        class LiveHandler(BaseHTTPRequestHandler):
            """Answers one request."""

            def do_GET(self) -> None:
                """Answer; refuse other hosts' requests."""
                known = {f"{host}:{page._server.server_port}" for host in (HOST, "localhost")}
                if self.headers.get("Host") not in known:
                    self.send_error(HTTPStatus.FORBIDDEN)
                    return
                found = page.answer(urlsplit(self.path).path)
                if found is None:
                    self.send_error(HTTPStatus.NOT_FOUND)
                    return
                kind, content = found
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: Any) -> None:
                """Write nothing: the terminal shows the batch."""

        return LiveHandler
