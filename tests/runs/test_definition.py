"""Every key that a run writes has one definition, which reads it back: nothing written is lost, nothing is unread."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from symphys import files
from symphys.findings.examination import Examination
from symphys.results.config import Config
from symphys.results.file_names import CONFIG, RESULT, SCENE, TRAJECTORY
from symphys.results.result import Result, read_result
from symphys.results.run import read_run
from symphys.results.scene import read_scene
from symphys.runs import Job, execute
from symphys.runs.execute import TranscriptionCache
from symphys.trajectory import Trajectory, shapes
from symphys.transcription import transcribe

MakeJob = Callable[..., Job]


def run(job: Job) -> Result:
    return execute(job, lambda row: None, TranscriptionCache(transcribe))


def unread(kind: Any, value: Any, path: str = "") -> Iterator[str]:
    """The keys of a JSON object that no field of a record reads, also inside."""
    hints = get_type_hints(kind)
    keys = {field.metadata.get("key", field.name): hints[field.name] for field in fields(kind)}
    tables = {key.partition(".")[0] for key in keys if "." in key}
    for key, entry in value.items():
        if key in tables:
            yield from (f"{path}{key}.{each}" for each in entry or () if f"{key}.{each}" not in keys)
        elif key not in keys:
            yield f"{path}{key}"
        else:
            hint, entries = keys[key], entry
            if get_origin(hint) in (tuple, Mapping):
                hint, entries = get_args(hint)[-1 if get_origin(hint) is Mapping else 0], entry or ()
                entries = entries.values() if isinstance(entries, Mapping) else entries
            else:
                entries = [entry]
            if is_dataclass(hint):
                for each in entries:
                    yield from unread(hint, each, f"{path}{key}.")


@pytest.mark.parametrize("does", ["solve", "miss", "refuse"])
def test_every_key_of_a_result_is_read_and_written_again(make_job: MakeJob, does: str) -> None:
    job = make_job(examine=True, does=does)
    result = run(job)
    written = files.read_json(job.folder.path / RESULT)
    assert set(unread(Result, written)) <= {"format", "z.shape"}
    assert list(unread(Examination, written["trust"] or {})) == []
    assert files.strict(read_result(job.folder.path / RESULT).to_json()) == written
    assert read_result(job.folder.path / RESULT) == result
    assert replace(Config.from_json(files.read_json(job.folder.path / CONFIG)), key="") == replace(job.config, key="")


def test_the_page_reads_what_the_run_wrote(make_job: MakeJob) -> None:
    job = make_job(examine=True)
    result = run(job)
    read = read_run(job.folder.path, job.folder.path)
    assert files.strict(read.to_json()) == files.strict(result.to_json())
    assert read.faults == () and read.examination.gradient[0].variable == "throw"


def test_a_scene_is_written_again_as_it_was(make_job: MakeJob) -> None:
    job = make_job(examine=True)
    run(job)
    path = job.folder.path / SCENE
    assert files.strict(read_scene(path).to_json()) == files.read_json(path)


def test_every_array_of_a_motion_has_a_field_with_its_shape(make_job: MakeJob) -> None:
    job = make_job(examine=True)
    run(job)
    with np.load(job.folder.path / TRAJECTORY, allow_pickle=False) as motion:
        assert set(motion.files) == {field.name for field in fields(Trajectory)}
        assert {name: motion[name].ndim for name in shapes()} == {name: len(each) for name, each in shapes().items()}


def test_columns_of_older_traces_keep_their_meaning(make_job: MakeJob, tmp_path: Path) -> None:
    job = make_job(examine=True)
    run(job)
    before = read_run(job.folder.path, job.folder.path).trace
    path = job.folder.path / "trace.csv"
    header, rest = path.read_text(encoding="utf-8").split("\n", 1)
    header = header.replace("max_violation", "miss") + ",told: speed [m/s]"
    rows = [f"{row},0.5" for row in rest.splitlines()]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    after = read_run(job.folder.path, job.folder.path).trace
    assert np.array_equal(before["max_violation"], after["max_violation"])
    assert after.outputs == ["speed [m/s]"] and set(after["output: speed [m/s]"]) == {0.5}
