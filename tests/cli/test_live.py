"""``symphys solve --live``: a page on this machine while it solves, which goes on to the report."""

from __future__ import annotations

import http.client
import json
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tools.browser import BROWSER, CHROMIUM, FLAGS
from tools.waiting import FOREVER

from symphys.batches import Observer
from symphys.cli.watching import live_page
from symphys.cli.watching.live_page import MOST_ROWS, LivePage

JOB: Any = SimpleNamespace(name="throw gradient seed 0")


def row(iteration: int) -> Any:
    return SimpleNamespace(
        iteration=iteration, seconds=0.1 * iteration, objective=1 / (1 + iteration), max_violation=2.0
    )


class Ask:
    """Asks the server of a page."""

    def __init__(self, page: LivePage) -> None:
        self.port = int(page.address.rstrip("/").rpartition(":")[2])

    def __call__(self, path: str, host: str = "") -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=FOREVER)
        connection.request("GET", path, headers={"Host": host or f"127.0.0.1:{self.port}"})
        answer = connection.getresponse()
        return answer.status, answer.read()


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(live_page, "LINGER", 0.0)
    made = LivePage(Observer(), tmp_path / "out")
    yield made
    made.close(None)


def test_it_shows_the_iterations_so_far(page: LivePage) -> None:
    ask = Ask(page)
    page.started(JOB, False)
    for k in range(3):
        page.advanced(JOB, row(k))
    status, content = ask("/state")
    (run,) = json.loads(content)["runs"]
    assert status == 200 and run["name"] == JOB.name and run["words"] == "iteration 2"
    assert run["objective"] == [1.0, 0.5, pytest.approx(1 / 3)] and len(run["seconds"]) == len(run["worst"]) == 3
    status, content = ask("/")
    assert status == 200 and b"connect-src &#x27;self&#x27;" in content and b"ask();" in content


@BROWSER
def test_a_browser_draws_the_curves(page: LivePage) -> None:
    """Without a complaint of the browser; the page asks the server, which its policy allows."""
    page.started(JOB, False)
    for k in range(40):
        page.advanced(JOB, row(k))
    assert CHROMIUM is not None
    call = [CHROMIUM, *FLAGS, "--dump-dom", "--virtual-time-budget=3000", page.address]
    done = subprocess.run(call, capture_output=True, text=True, timeout=FOREVER, check=False)
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    assert len(re.findall(r'<svg viewBox="0 0 \d+ ', done.stdout)) == 1 and f'<h1 id="title">{JOB.name}' in done.stdout
    assert "iteration 39, objective 0.025" in done.stdout and "Largest error / tolerance" in done.stdout


def test_many_iterations_are_thinned(page: LivePage) -> None:
    page.started(JOB, False)
    for k in range(5000):
        page.advanced(JOB, row(k))
    (run,) = json.loads(Ask(page)("/state")[1])["runs"]
    assert MOST_ROWS / 4 < len(run["seconds"]) < MOST_ROWS and run["seconds"] == sorted(run["seconds"])


def test_other_hosts_and_other_files_are_refused(page: LivePage, tmp_path: Path) -> None:
    """No page of the web can read it by a name that leads here, and nothing outside its folder is there."""
    ask = Ask(page)
    assert ask("/state", "evil.example")[0] == ask("/", "127.0.0.1")[0] == 403
    (tmp_path / "secret.html").write_text("secret")
    assert [ask(path)[0] for path in ("/report/index.html", "/nothing", "/report/../secret.html")] == [404] * 3


def test_it_goes_on_to_the_report(page: LivePage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The server stays until the report was fetched; pages and their scripts alone are served."""
    (tmp_path / "out").mkdir()
    for name, text in (("index.html", "the report"), ("result.json", "{}")):
        (tmp_path / "out" / name).write_text(text)
    ask, answers, sleep = Ask(page), list[Any](), live_page.sleep

    def asked(seconds: float) -> None:
        if not answers:
            answers.append(json.loads(ask("/state")[1])["done"])
            answers.extend([ask(answers[0]), ask("/report/result.json")[0], ask("/report/%2e%2e/secret.html")[0]])
        sleep(seconds)

    monkeypatch.setattr(live_page, "sleep", asked)
    page.close(tmp_path / "out" / "index.html")
    assert answers == ["/report/index.html", (200, b"the report"), 404, 404]
