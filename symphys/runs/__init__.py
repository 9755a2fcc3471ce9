"""Runs: solve problems, and write run folders that can be read, skipped and continued."""

from symphys.results.file_names import RESULT, SCENE, TRAJECTORY
from symphys.results.result import Result, read_result
from symphys.results.scene_of_problem import make_scene
from symphys.runs.claim import FolderBusy
from symphys.runs.execute import execute
from symphys.runs.folder import RunFolder
from symphys.runs.guess import RunGuess, read_guess_run
from symphys.runs.job import Job, check_tables, make_jobs

__all__ = [
    "RESULT",
    "SCENE",
    "TRAJECTORY",
    "FolderBusy",
    "Job",
    "Result",
    "RunFolder",
    "RunGuess",
    "check_tables",
    "execute",
    "make_jobs",
    "make_scene",
    "read_guess_run",
    "read_result",
]
