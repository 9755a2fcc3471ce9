"""Progress while work goes on: live lines on a terminal, plain ones elsewhere, events for other programs.

The share done and the time left come from the budget of a run, the finished runs of a batch, or known parts of work.
"""

from symphys.cli.watching.heartbeat import working
from symphys.cli.watching.live_page import LivePage
from symphys.cli.watching.observers import watch

__all__ = ["LivePage", "watch", "working"]
