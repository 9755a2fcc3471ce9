"""Reports made from run folders alone: a page for a run, a batch, a motion, an identification.

Every page is one HTML file that shows all without anything else: no network, no other file. Beside a full one lies a
folder with its figures as SVG and CSV, to which it links; a light one draws its curves itself. Importing this package
imports matplotlib; import it where a report is written, not before. ``symphys.write_report`` makes the pages of all
runs below a folder.
"""

from symphys.report.making.batch import WantedPages, make_pages, outdated, wanted_below, write_report
from symphys.report.pages.batch import write_batch_report
from symphys.report.pages.closed_loop import write_closed_loop_page
from symphys.report.pages.identification import identification_folders, write_identification_page
from symphys.report.pages.motion import write_motion, write_motion_page
from symphys.report.pages.run import write_light_report, write_run_figures, write_run_report

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
