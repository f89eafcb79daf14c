"""Engines with a state (propellers, pistons, spools) are steady where a flight begins."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.setup import Engines, Setup
from aircraft.autopilots.specification import margin_rows
from aircraft.check.check import check
from aircraft.jsbsim.engines import settle
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin, positions
from aircraft.jsbsim.loading import Executive
from aircraft.jsbsim.properties import ENGINE_STATES
from aircraft.jsbsim.rest import Start

THROTTLE = "fcs/throttle-cmd-norm"
CALM = (0.0, 0.0, 0.0)
ELECTRIC = '<electric_engine name="motor"><power unit="WATTS"> 600 </power></electric_engine>'
TURBINE = """<turbine_engine name="motor">
  <milthrust> 8 </milthrust> <bypassratio> 0 </bypassratio> <tsfc> 1 </tsfc> <bleed> 0.03 </bleed>
  <idlen1> 30 </idlen1> <idlen2> 50 </idlen2> <maxn1> 100 </maxn1> <maxn2> 100 </maxn2>
  <augmented> 0 </augmented> <injected> 0 </injected>
  <function name="IdleThrust"><value> 0.01 </value></function>
  <function name="MilThrust"><value> 1 </value></function>
</turbine_engine>"""
RATIOS = np.arange(13) / 10
THRUST = "\n".join(f"{j:.1f} {max(0.10 * (1 - j / 0.9), -0.05):.4f}" for j in RATIOS)
POWER = "\n".join(f"{j:.1f} {max(0.05 * (1 - (j / 1.1) ** 2), -0.02):.4f}" for j in RATIOS)
PROPELLER = f"""<propeller name="screw">
  <ixx> 0.0002 </ixx> <diameter unit="IN"> 14 </diameter> <numblades> 2 </numblades>
  <minpitch> 20 </minpitch> <maxpitch> 20 </maxpitch>
  <table name="C_THRUST" type="internal"><tableData>\n{THRUST}\n</tableData></table>
  <table name="C_POWER" type="internal"><tableData>\n{POWER}\n</tableData></table>
</propeller>"""
HEAD = '<?xml version="1.0"?>\n'


def powered(folder, engine, thruster):
    """An X8 with JSBSim's own engine in place of the external reaction that drives it."""
    airframe = copy("x8", folder)
    model = airframe / "x8.xml"
    text = re.sub(r"<external_reactions>.*?</external_reactions>", "", model.read_text(), flags=re.S)
    text = text.replace('<thruster file="direct">', f'<thruster file="{thruster}">')
    if engine is not ELECTRIC:
        where = '<location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>'
        fuel = '<capacity unit="KG"> 2 </capacity><contents unit="KG"> 1 </contents>'
        tank = f'<tank type="FUEL">{where}{fuel}</tank>'
        text = text.replace("</engine>", "<feed> 0 </feed></engine>").replace(
            "</propulsion>", tank + "</propulsion>"
        )
        toml = airframe / "airframe.toml"
        toml.write_text(toml.read_text().replace("mass_kg = 3.364", "mass_kg = 4.364"))
    model.write_text(text)
    (airframe / "engine" / "motor.xml").write_text(HEAD + engine)
    (airframe / "engine" / "screw.xml").write_text(HEAD + PROPELLER)
    return airframe


ENGINES = {"electric": (ELECTRIC, "screw"), "turbine": (TURBINE, "direct")}


@pytest.fixture(scope="module", params=ENGINES)
def airframe(request, tmp_path_factory):
    return load(powered(tmp_path_factory.mktemp("aircraft") / request.param, *ENGINES[request.param]))


def test_level_flight_goes_on_as_it_began(airframe):
    """Whoever begins without thrust is 1.1 m/s slower after the first second."""
    fdm = Fdm(airframe, 0.005, Origin())
    trimmed = fdm.start(Start(0.0, 0.0, 0.0, 0.0, 20.0))
    thrust = fdm.read("propulsion/engine/thrust-lbs")
    assert 0.05 < trimmed.throttle < 0.9 and thrust > 0.2
    assert fdm.read("simulation/sim-time-sec") == 0.0
    fdm.run(CALM, 1)
    assert fdm.read("propulsion/engine/thrust-lbs") == pytest.approx(thrust, rel=1e-4)
    fdm.run(CALM, 400)
    east, north, *_ = (fdm.read(f"velocities/v-{axis}-fps") * 0.3048 for axis in ("east", "north"))
    assert np.hypot(east, north) == pytest.approx(20.0, abs=0.02)


def test_it_begins_where_it_was_asked_to(airframe):
    """The Earth turns while engines settle: 465 m/s at the equator."""
    fdm = Fdm(airframe, 0.005, Origin())
    fdm.start(Start(100.0, -50.0, 10.0, 0.3, 20.0))
    assert positions(fdm.position(), fdm.origin)[0] == pytest.approx([100.0, -50.0, 10.0], abs=1e-3)


def test_it_is_clean(airframe):
    assert [f for f in check(airframe.folder) if f.severity == "error"] == []


@pytest.mark.slow
def test_the_throttle_loop_has_the_margins_that_are_measured(tmp_path):
    """The linear model takes engines as settled: it would say 63 deg and 39 dB."""
    airframe = load(powered(tmp_path / "electric", ELECTRIC, "screw"))
    found = {row.quantity: row.value for row in margin_rows(airframe, [20.0]) if "throttle" in row.case}
    assert found["phase_deg"] == pytest.approx(48.7, abs=2.0)
    assert found["gain_db"] == pytest.approx(14.0, abs=1.0)


class Stock:
    """One of JSBSim's own aircraft at 3000 ft, throttle 0.6, as `settle` wants it."""

    def __init__(self, name, feet_per_s):
        self.airframe = SimpleNamespace(name=name, engines=Engines(), setup=Setup())
        self.forgets = None
        self.executive = Executive(None)
        self.executive.set_debug_level(0)
        self.executive.set_dt(0.005)
        self.executive.load_model(name)
        given = {
            "ic/h-sl-ft": 3000,
            "ic/u-fps": feet_per_s,
            "ic/theta-rad": 0.03,
            "fcs/throttle-cmd-norm": 0.6,
        }
        for path, value in given.items():
            self.node(path).set_double_value(value)
        self.run_ic()
        manager = self.executive.get_property_manager()
        states = (manager.get_node(f"propulsion/engine/{state}") for state in ENGINE_STATES)
        self.engine_states = [state for state in states if state is not None]

    def node(self, path):
        return self.executive.get_property_manager().get_node(path)

    def thrust(self):
        return self.node("propulsion/engine/thrust-lbs").get_double_value()

    def run_ic(self):
        self.executive.set_trim_status(True)
        self.executive.run_ic()
        self.executive.set_trim_status(False)


@pytest.mark.parametrize(("name", "feet_per_s", "pounds"), [("c172p", 180, 134.4), ("T37", 400, 323.6)])
def test_pistons_and_turbines_of_stock_aircraft_settle(name, feet_per_s, pounds):
    """Thrusts as after minutes of running with the body held, found by hand with JSBSim alone."""
    stock = Stock(name, feet_per_s)
    settle(stock)
    assert stock.thrust() == pytest.approx(pounds, rel=0.02)
    for _ in range(3):
        stock.executive.run()
    assert stock.thrust() == pytest.approx(pounds, rel=0.02)


def test_a_turboprop_that_forgets_its_state_is_left_running():
    """Evaluated at dt = 0 its spools fall to idle: 1300 lbs become what a windmilling propeller leaves."""
    stock = Stock("pc7", 300)
    settle(stock)
    running = stock.thrust()
    assert stock.forgets
    for _ in range(3):
        stock.executive.run()
    assert stock.thrust() == pytest.approx(running, rel=0.02)
