"""Reports made from run folders alone: a page for a run, a batch, a motion, an identification, a closed loop.

Every page is one HTML file that shows all without anything else: no network, no other file. The browser draws its
curves and plays its motion. ``write_run_figures`` writes the figures of a run as files, drawn by matplotlib, which is
imported then. ``symphys.write_report`` makes the pages of all runs below a folder.
"""

import warnings
from pathlib import Path

from symphys.report.making.batch import WantedPages, make_pages, outdated, wanted_below, write_report
from symphys.report.pages.batch import write_batch_report
from symphys.report.pages.closed_loop import write_closed_loop_page
from symphys.report.pages.identification import identification_folders, write_identification_page
from symphys.report.pages.motion import write_motion, write_motion_page
from symphys.report.pages.run import write_run_figures, write_run_report

__all__ = [
    "WantedPages",
    "identification_folders",
    "make_pages",
    "outdated",
    "wanted_below",
    "write_batch_report",
    "write_closed_loop_page",
    "write_identification_page",
    "write_light_report",
    "write_motion",
    "write_motion_page",
    "write_report",
    "write_run_figures",
    "write_run_report",
]


def write_light_report(run_dir: Path) -> Path:
    """Deprecated: call ``write_run_report``, which writes the same page."""
    warnings.warn("write_light_report is deprecated; use write_run_report", DeprecationWarning, stacklevel=2)
    return write_run_report(run_dir)
