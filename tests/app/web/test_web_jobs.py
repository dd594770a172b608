import asyncio
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import web_tasks
from support.processes import IN_PROC, is_alive

import mbs.app.web.jobs as jobs
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.errors import DescriptionError, Unclosable

ARM = Document.of_name("planar_2r")


def run(task, *args, document=ARM, progress=None):
    return asyncio.run(jobs.run(task, document, *args, progress=progress))


def test_a_task_runs_in_another_process_and_tells_how_far_it_is():
    heard = []
    name, nq, pid = run(web_tasks.counted, 1000, progress=lambda *told: heard.append(told))
    assert (name, nq) == ("planar_2r", 2)
    assert pid != os.getpid()
    assert {label for label, _ in heard} == {"counting"}
    parts = [part for _, part in heard]
    assert parts == sorted(parts)
    assert parts[-1] == 1.0
    assert 50 < len(parts) < 150


def test_the_error_of_a_task_comes_back_as_it_is():
    with pytest.raises(Unclosable, match=r"^arm: no configuration; change it$"):
        run(web_tasks.refused, "arm: no configuration; change it")


def test_a_wrong_document_is_refused_with_its_sentence():
    wrong = ARM.changed(Cell("geometry", 1, "d"), "*")
    with pytest.raises(DescriptionError, match="frame 2, d: cannot read"):
        run(web_tasks.counted, 1, document=wrong)


def test_any_other_end_is_one_sentence_and_the_details_are_logged(caplog):
    with pytest.raises(jobs.JobError, match=r"ZeroDivisionError.*please report it") as caught:
        run(web_tasks.broken)
    assert "\n" not in str(caught.value)
    assert "Traceback" in caplog.text
    with pytest.raises(jobs.JobError, match="ended without an answer"):
        run(web_tasks.vanished)


def ended(pids):
    """Whether all of them end within some seconds."""
    for _ in range(500):
        if not any(is_alive(pid) for pid in pids):
            return True
        time.sleep(0.02)
    return False


def told_in(path):
    """The words that `endless` writes, once it has."""
    for _ in range(3000):
        if path.exists():
            return path.read_text().split()
        time.sleep(0.02)
    raise AssertionError("the task does not begin")


@IN_PROC
def test_a_child_does_not_outlive_the_server(tmp_path):
    told = tmp_path / "told"
    code = (
        "import asyncio, sys\n"
        "from support import web_tasks\n"
        "import mbs.app.web.jobs as jobs\n"
        "from mbs.app.web.document.document import Document\n"
        "if __name__ == '__main__':\n"
        "    arm = Document.of_name('planar_2r')\n"
        "    asyncio.run(jobs.run(web_tasks.endless, arm, sys.argv[1]))\n"
    )
    path = os.pathsep.join(filter(None, sys.path))
    command = [sys.executable, "-c", code, str(told)]
    with subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}) as server:
        scratch, *pids = told_in(told)
        server.kill()
    assert ended(pids)
    assert not Path(scratch).exists()


@IN_PROC
def test_cancel_ends_the_child_what_it_started_and_its_temporary_files(tmp_path):
    told = tmp_path / "told"

    async def cancelled():
        work = asyncio.ensure_future(jobs.run(web_tasks.endless, ARM, str(told)))
        for _ in range(3000):
            if told.exists():
                break
            await asyncio.sleep(0.02)
        scratch, *pids = told.read_text().split()
        assert Path(scratch).exists()
        assert all(is_alive(pid) for pid in pids)
        work.cancel()
        with pytest.raises(asyncio.CancelledError):
            await work
        return scratch, pids

    scratch, pids = asyncio.run(cancelled())
    assert not Path(scratch).exists()
    assert ended(pids)
