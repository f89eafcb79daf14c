"""Aircraft stepped by several processes: the same numbers, and nothing left behind, however a run ends."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import psutil
import pytest

import testbed
from aircraft.airframe import load
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.jsbsim.stepping import shared
from aircraft.jsbsim.stepping.waiting import AWAKE_S, Inbox
from filters.model import Command, State
from testbed.campaigns import bases, child
from testbed.campaigns.identity import content_id
from testbed.components.fleet_workers import VARIABLE, fleet_workers
from testbed.scenario.location import identity

KINDS = ["x8", "rascal", "x8"]
PLACES = State(
    [0.0, 300.0, 600.0], 0.0, [0.0, 1.0, 2.0], [0.0, -299.6, 20.0]
)  # the second is near the ground
X8S = ["plant=jsbsim", "lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]


def fleet(workers: int, turbulence: tuple[float, int] | None = None) -> JsbsimFleet:
    kinds = {name: load(name) for name in KINDS}
    return JsbsimFleet([kinds[name] for name in KINDS], turbulence=turbulence, workers=workers)


def flown(workers: int) -> list[np.ndarray]:
    """Everything that the plant says of some steps of different length, a vehicle's fault among them."""
    plant, draw = fleet(workers, (10.0, 4)), np.random.default_rng(5)
    plant.reset(PLACES, np.random.default_rng(3))
    assert len(plant.pids) == min(workers, 3) - 1
    said = [plant.state().array()]
    for k, n in enumerate((1, 12, 200, 3, 7)):
        asked = Command(draw.uniform(15, 25, 3), draw.uniform(-0.2, 0.2, 3), np.array([1.0, -3.0, -2.0]))
        said += [plant.step(asked, draw.normal(size=(3, 3)), n), plant.state().array()]
        said += [plant.achieved().array(), np.array(plant.faults())]
        said += list(plant.telemetry().values()) if k != 2 else []
    assert plant.faults() == ["", "hit the ground", ""]
    plant.close()
    return said


def gone(pid: int) -> bool:
    """Whether the process ends within some seconds; one whose parent has not asked how has ended, too."""
    for _ in range(200):
        try:
            if psutil.Process(pid).status() == psutil.STATUS_ZOMBIE:
                return True
        except psutil.NoSuchProcess:
            return True
        time.sleep(0.05)
    return False


def test_any_number_of_workers_gives_the_same_numbers_to_the_last_bit():
    alone = flown(1)
    for workers in (2, 5):  # more than there are vehicles
        for one, other in zip(alone, flown(workers), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_killed_worker_is_a_fault_that_names_it_and_its_vehicles():
    session = testbed.assemble(testbed.load_scenario("paper-2-turn", [*X8S, "rates.workers=2"]))
    session.reset()
    session.step()
    pids = children()
    assert len(pids) == 1
    os.kill(pids[0], signal.SIGKILL)
    while not session.step().done:
        pass
    end = session.judge().manifest["ended_early"]
    assert "worker process 2, vehicles 2 to 2, died of SIGKILL" in end
    assert all(map(gone, pids))


def children() -> list[int]:
    """Worker processes of this one."""
    found = psutil.Process().children()
    return [p.pid for p in found if p.is_running() and any("stepping.worker" in word for word in p.cmdline())]


def test_full_shared_memory_is_said_before_anything_flies(monkeypatch):
    def full(file: int, start: int, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    scenario = testbed.load_scenario("paper-2-turn", [*X8S, "rates.workers=2"])
    with pytest.raises(
        testbed.UserError, match=r"MB of shared memory in .*: No space left on device; make room"
    ):
        testbed.run(scenario)
    assert not children() and not segments()


def test_memory_that_fills_up_later_is_said_in_words(monkeypatch):
    numbers = shared.Shared.new(3, 5, 1)

    def full(file: int, start: int, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(shared.NoRoomError, match="No space left on device"):
        numbers.tell(np.zeros((3, 3)), np.zeros((3, 3)), 5000, True)
    os.close(numbers.file)


def segments() -> list[str]:
    return [name for name in os.listdir(shared.folder()) if name.startswith("fleet-")]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_stopped_leaves_neither_processes_nor_memory(number):
    program = """
import numpy as np
from aircraft.airframe import load
from aircraft.jsbsim.fleet import JsbsimFleet
from filters.model import Command, State
fleet = JsbsimFleet([load("x8")] * 2, workers=2)
fleet.reset(State([0.0, 300.0], 0.0, 0.0, 0.0), np.random.default_rng(0))
print(*fleet.pids, flush=True)
while True:
    fleet.step(Command(np.full(2, 20.0), np.zeros(2), np.zeros(2)), np.zeros((2, 3)), 100)
"""
    flying = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert flying.stdout is not None
    worker = int(flying.stdout.readline())
    flying.send_signal(number)
    assert flying.wait(20) != 0
    flying.stdout.close()
    assert gone(worker) and not segments()


@pytest.mark.parametrize("late_s", [0.0, 3 * AWAKE_S])
def test_what_is_sent_while_a_process_looks_or_sleeps_arrives_and_a_closed_pipe_is_noticed(late_s):
    out, into = os.pipe()
    with os.fdopen(out, "rb") as stream:
        inbox = Inbox(stream)
        timer = threading.Timer(late_s, lambda: (os.write(into, b"s"), os.close(into)))
        timer.start()
        assert (inbox.read(), inbox.read()) == (b"s", b"")
        timer.join()


def test_a_worker_that_finds_no_steady_flight_says_so_in_the_same_words():
    plant = fleet(2)
    with pytest.raises(RuntimeError, match=r"^x8 cannot fly steadily at ground speed 300 m/s"):
        plant.reset(PLACES, np.random.default_rng(0), speed=[20.0, 20.0, 300.0])
    assert not plant.pids


def test_small_fleets_are_stepped_by_one_process_and_large_ones_by_all(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr("testbed.components.fleet_workers.processors", lambda: 4)
    monkeypatch.setattr(os, "getloadavg", lambda: (4.0, 9.0, 9.0))

    def chosen(*more: str) -> int:
        return fleet_workers(testbed.load_scenario("paper-20-turn", [*X8S, *more]))

    assert chosen("duration_s=20") == 1  # over before they have started
    assert chosen("duration_s=200") == 4
    assert chosen("duration_s=200", "vehicles=27", "start.radius_m=300", "filter_dt_s=0.005") == 4
    few = "start.radius_m=300", "duration_s=2000"
    assert chosen(*few, "vehicles=7") == 4
    assert chosen(*few, "vehicles=6") == 1  # they would wait for one another all the time
    assert chosen(*few, "vehicles=26", "filter_dt_s=0.005") == 1
    assert chosen("duration_s=20", "rates.workers=3") == 3
    assert chosen("duration_s=20", "rates.workers=30") == 20
    monkeypatch.setattr(os, "getloadavg", lambda: (8.0, 0.0, 0.0))
    assert chosen("duration_s=200") == 1  # others keep all processors busy
    monkeypatch.setenv(VARIABLE, child.ENVIRONMENT[VARIABLE])  # within a campaign's worker
    assert chosen("duration_s=200") == 1


def test_the_number_of_workers_is_no_part_of_what_a_scenario_is():
    one, two = (testbed.load_scenario("paper-2-turn", [*X8S, *more]) for more in ([], ["rates.workers=2"]))
    assert one.model_dump(mode="json") == two.model_dump(mode="json")
    assert content_id(identity(one.model_dump(mode="json"))) == content_id(
        identity(two.model_dump(mode="json"))
    )


@pytest.mark.parametrize("said", ["0", "257", "2.5", "true", "many"])
def test_a_number_of_workers_that_is_none_is_refused(said):
    with pytest.raises(testbed.UserError, match=r"rates\.workers: a whole number of processes from 1 to 256"):
        testbed.load_scenario("paper-2-turn", [*X8S, f"rates.workers={said}"])


def test_workers_have_no_effect_on_unicycles():
    with pytest.raises(testbed.UserError, match=r"rates\.workers: has no effect: plant 'unicycle'"):
        testbed.load_scenario("paper-2-turn", ["rates.workers=2"])


def test_a_campaign_says_that_it_steps_each_run_by_one_process(tmp_path):
    file = tmp_path / "many.toml"
    said = (
        'name = "many"\nscenario = "paper-2-turn"\nseeds = 2\n[set]\n"rates.workers" = 2\nplant = "jsbsim"\n'
    )
    file.write_text(said)
    from testbed.campaigns import file as campaign_file

    campaign, here = campaign_file.load(str(file))
    with pytest.raises(testbed.UserError, match=r"set\.rates\.workers: a campaign's workers step each run"):
        bases.bases(campaign, here)
