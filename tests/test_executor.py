"""The executor: every job answered once, and a job that takes its process along takes nothing else."""

from __future__ import annotations

import math
import signal
import time

import psutil
import pytest

from testbed.campaigns.engine import fly_all
from testbed.campaigns.executor import executor
from testbed.campaigns.outcome import CrashError
from testbed.campaigns.processes import Processes


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
