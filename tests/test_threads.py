"""Runs in several threads of one process: the numbers of runs one after the other, and no abort."""

from __future__ import annotations

import subprocess
import sys

import pytest

# In a process of its own: what goes wrong here ends the interpreter.
CODE = """
import threading
import testbed

settings = ["plant=jsbsim", "duration_s=0.3", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=1"]
scenario = testbed.load_scenario("paper-2-turn", settings)
missing = testbed.load_scenario("paper-2-turn", [*settings, "start.speed_mps=6"])
seen = []

def fly(scenario):
    try:
        seen.append(testbed.run(scenario).guarantee("separation")["value"])
    except testbed.UserError as error:
        seen.append("refused" if "cannot fly steadily" in str(error) else str(error))

for _ in range(3):
    threads = [threading.Thread(target=fly, args=[s]) for s in (scenario, missing, scenario)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
value = testbed.run(scenario).guarantee("separation")["value"]
assert sorted(map(str, seen)) == sorted([str(value)] * 6 + ["refused"] * 3), seen
print("done")
"""


@pytest.mark.slow
def test_aircraft_fly_in_several_threads_and_threads_end() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout.strip() == "done", done.stderr[-2000:]
