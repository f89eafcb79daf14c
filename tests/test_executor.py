"""The executor: every job answered once, and a job that takes its process along takes nothing else."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from testbed.campaigns.engine import fly_all
from testbed.campaigns.executor import executor
from testbed.campaigns.outcome import CrashError
from testbed.campaigns.processes import Processes
from testbed.errors import UserError


def test_every_job_is_answered_once_and_by_its_number() -> None:
    jobs = [float(k * k) for k in range(50)]
    with executor(2) as pool:
        outcomes = list(pool.imap(math.sqrt, jobs))
        assert sorted(o.index for o in outcomes) == list(range(50))
        assert all(o.value() == o.index and o.wall_s >= 0 and o.worker for o in outcomes)
        # The same processes go on.
        assert {o.worker for o in pool.imap(math.sqrt, jobs)} <= {o.worker for o in outcomes}


def test_what_raises_is_an_outcome_among_others() -> None:
    with executor(2) as pool:
        outcomes = {o.index: o for o in pool.imap(math.sqrt, [4.0, -1.0, 9.0])}
    assert (outcomes[0].value(), outcomes[2].value()) == (2.0, 3.0)
    with pytest.raises(ValueError, match="math domain error"):
        outcomes[1].value()


def test_a_crash_has_one_culprit() -> None:
    # Signal 0 does nothing.
    jobs = [0, int(signal.SIGSEGV), 0, int(signal.SIGKILL), 0, 0]
    with executor(2) as pool:
        outcomes = {o.index: o for o in pool.imap(signal.raise_signal, jobs)}
    reasons = {k: str(o.error) for k, o in outcomes.items() if isinstance(o.error, CrashError)}
    assert reasons == {1: "its process died of SIGSEGV, 2 times", 3: "its process died of SIGKILL, 8 times"}
    assert all(outcomes[k].error is None for k in (0, 2, 4, 5))


def test_work_that_prints_or_exits_disturbs_no_answer() -> None:
    with executor(1) as pool:
        first, second, third = pool.imap(eval, ["print('noise') or 1", "exit(3)", "2"])
        assert (first.value(), str(second.error), third.value()) == (1, "SystemExit: 3", 2)


def test_abandoned_work_is_stopped_at_once() -> None:
    with Processes(2) as pool:
        ended = pool.imap(time.sleep, [0.0, 60.0, 60.0])
        next(ended)
        children = [psutil.Process(pid) for pid in pool.pids if pid is not None]
        began = time.monotonic()
        ended.close()
        assert time.monotonic() - began < 20
        assert not psutil.wait_procs(children, timeout=10)[1]
        assert [o.value() for o in pool.imap(math.sqrt, [4.0])] == [2.0]


def test_flying_all_answers_in_order_and_raises_what_a_job_raised() -> None:
    assert fly_all(math.sqrt, [16.0, 4.0, 9.0], workers=2) == [4.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="math domain error"):
        fly_all(math.sqrt, [4.0, -1.0, 9.0], workers=2)


SCRIPT = """
import os, sys, threading
from testbed.campaigns.executor import executor

class Result:
    def __init__(self, x):
        self.x = x

class NeedsTwo(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")

class HoldsALock(Exception):
    def __init__(self, text):
        super().__init__(text)
        self.lock = threading.Lock()

class WithoutText(Exception):
    def __str__(self):
        raise RuntimeError

class LoadsNowhere:
    def __reduce__(self):
        return int, ("x",)

def square(x): return x * x
def result(x): return Result(x)
def lock(x): return threading.Lock()
def loads_nowhere(x): return LoadsNowhere()
def needs_two(x): raise NeedsTwo(1, 2)
def holds_a_lock(x): raise HoldsALock("held")
def without_text(x): raise WithoutText
def exits(x): os._exit(7)
def reads(x): return sys.stdin.read()
def outer():
    def inner(x): return x
    return inner

if __name__ == "__main__":
    work = eval(sys.argv[1])
    jobs = eval(sys.argv[2])
    with executor(workers=1) as pool:
        for outcome in pool.imap(work, jobs):
            error, result = outcome.error, outcome.result
            if error is None:
                print(getattr(result, "x", result))
            else:
                print(type(error).__name__ + ("" if isinstance(error, WithoutText) else f": {error}"))
"""


def script(tmp_path: Path, work: str, jobs: str = "[3]") -> subprocess.CompletedProcess[str]:
    """What a user's own script prints that hands its functions to the executor; it must end."""
    (tmp_path / "mine.py").write_text(SCRIPT, encoding="utf-8")
    command = [sys.executable, "mine.py", work, jobs]
    return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "said"),
    [
        ("square", "9"),
        ("result", "3"),
        ("lock", "UserError: the result, a lock, cannot be sent back: TypeError"),
        ("loads_nowhere", "UserError: the answer of a worker cannot be read here: ValueError"),
        ("needs_two", "RuntimeError: NeedsTwo: 1 and 2"),
        ("holds_a_lock", "RuntimeError: HoldsALock: held"),
        ("without_text", "WithoutText"),
        ("exits", "CrashError: its process ended with exit code 7, 2 times"),
        ("reads", ""),
    ],
)
def test_a_function_of_the_users_script_gives_its_result_or_one_error(
    work: str, said: str, tmp_path: Path
) -> None:
    done = script(tmp_path, work)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(said) and done.stdout.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("work", ["lambda x: x", "outer()"])
def test_a_function_without_a_place_is_refused(work: str, tmp_path: Path) -> None:
    done = script(tmp_path, work)
    assert done.returncode == 1
    assert "cannot be sent to a worker" in done.stderr.splitlines()[-1]
    assert "give a function defined at the top level of a module" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_a_job_that_cannot_be_sent_costs_no_other(tmp_path: Path) -> None:
    done = script(tmp_path, "square", "[2, threading.Lock(), lambda: 1, 3]")
    first, second, third, last = done.stdout.splitlines()
    assert (first, last) == ("4", "9")
    assert all(line.startswith("UserError: a job for square cannot be sent") for line in (second, third))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "said"),
    [
        (["noguard.py"], "put that part under if __name__ == '__main__'"),
        (["-c", "exec(open('noguard.py').read())"], "defined in an interactive session"),
    ],
)
def test_a_script_without_a_guard_or_a_file_is_told_so(script: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "noguard.py").write_text(
        "from testbed.campaigns.executor import executor\n"
        "def square(x): return x * x\n"
        "with executor(workers=1) as pool:\n"
        "    print([str(outcome.error) for outcome in pool.imap(square, [1])])\n"
    )
    done = subprocess.run(
        [sys.executable, *script], cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False
    )
    assert said in done.stdout + done.stderr


@pytest.mark.parametrize("workers", [0, -1, 2.5, "two"])
def test_a_number_of_workers_that_is_none_is_refused(workers: Any) -> None:
    with pytest.raises(UserError, match="a whole number of at least 1"):
        executor(workers=workers)


def test_jobs_may_come_from_an_iterator() -> None:
    with executor(workers=1) as pool:
        assert sorted(outcome.value() for outcome in pool.imap(abs, iter([-1, -2]))) == [1, 2]
