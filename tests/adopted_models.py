"""Models as users have them, made of the bare rascal and x8, for tests of adoption."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

from aircraft.airframes.schema import AIRFRAMES

ELEVATOR = """<fcs_function name="fcs/elevator-cmd-rad">
        <function>
          <product>
            <value> 0.5235987755982988 </value>
            <sum>
              <property> fcs/elevator-cmd-norm </property>
              <property> fcs/pitch-trim-cmd-norm </property>
            </sum>
          </product>
        </function>
      </fcs_function>"""
RUDDER = """<fcs_function name="fcs/rudder-cmd-rad">
        <function>
          <product> <value> 0.5235987755982988 </value> <property> fcs/rudder-cmd-norm </property> </product>
        </function>
      </fcs_function>"""
PROPELLER = re.compile(r"<external_reactions>.*?</external_reactions>", re.S)


def model(folder: Path, of: str, change: Callable[[str], str] = lambda text: text) -> Path:
    """Write the bare model of an airframe of the package, its text changed, into `folder`."""
    shutil.copytree(AIRFRAMES / of, folder, ignore=shutil.ignore_patterns("airframe.toml", "autopilot*"))
    path = folder / f"{of}.xml"
    text = path.read_text(encoding="utf-8").replace('<system file="autopilot"/>', "")
    path.write_text(change(text), encoding="utf-8")
    return folder


def replaced(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    return text


def elevons(folder: Path) -> Path:
    """The x8: two elevons, no rudder, a pusher's thrust."""
    return model(folder, "x8")


def tail(folder: Path) -> Path:
    """The rascal: elevator, ailerons and rudder, a tractor's thrust."""
    return model(folder, "rascal")


def v_tail(folder: Path) -> Path:
    """Two surfaces at the tail that mix elevator and rudder."""

    def change(text: str) -> str:
        mixed = "".join(
            f"""<fcs_function name="fcs/ruddervator-{side}-cmd-rad"><function><product>
              <value> 0.4 </value><{op}> <property> fcs/elevator-cmd-norm </property>
              <property> fcs/rudder-cmd-norm </property> </{op}></product></function></fcs_function>
            <actuator name="fcs/ruddervator-{side}-pos-rad"><input> fcs/ruddervator-{side}-cmd-rad </input>
              <lag> 20 </lag><clipto> <min> -0.5 </min> <max> 0.5 </max> </clipto></actuator>"""
            for side, op in (("left", "sum"), ("right", "difference"))
        )
        back = "".join(
            f"""<fcs_function name="fcs/{name}-pos-rad"><function><product> <value> 0.5 </value><{op}>
              <property> fcs/ruddervator-left-pos-rad </property>
              <property> fcs/ruddervator-right-pos-rad </property> </{op}></product></function>
            </fcs_function>"""
            for name, op in (("elevator", "sum"), ("rudder", "difference"))
        )
        for name in ("elevator", "rudder"):
            text = re.sub(rf'<actuator name="fcs/{name}-pos-rad">.*?</actuator>', "", text, flags=re.S)
        return replaced(text, (ELEVATOR, mixed + back), (RUDDER, ""))

    return model(folder, "rascal", change)


def electric(folder: Path) -> Path:
    """A glider with a motor and a propeller of JSBSim's: its shaft has a state."""

    def change(text: str) -> str:
        text = PROPELLER.sub("", text)
        return replaced(
            text,
            ('file="motor"', 'file="Zenoah_G-26A"'),
            ('file="direct"', 'file="APC_18x8E"'),
            ('<wingspan unit="M"> 2.795016', '<wingspan unit="M"> 4.0'),
            ("0.00  0.028", "0.00  0.016"),
            ("-0.26  0.056", "-0.26  0.040"),
            (" 0.26  0.056", " 0.26  0.040"),
        )

    return model(folder, "rascal", change)


def own_control(folder: Path) -> Path:
    """Its own flight control: a washed-out pitch damper, and an autopilot whose switch is ap/on."""
    damper = """<washout_filter name="sas/washed"><input> velocities/q-rad_sec </input><c1> 1 </c1>
      </washout_filter>
      <pure_gain name="sas/damper"><input> sas/washed </input><gain> 0.1 </gain></pure_gain>
      <switch name="ap/dive"><default value="0"/><test value="0.3"> ap/on == 1 </test></switch>
      <summer name="fcs/elevator-cmd-rad"><input> stick/elevator </input><input> sas/damper </input>
        <input> ap/dive </input></summer>"""

    def change(text: str) -> str:
        named = ELEVATOR.replace("fcs/elevator-cmd-rad", "stick/elevator")
        switch = '<system name="pilot"><property value="0"> ap/on </property></system>\n  <flight_control'
        return replaced(text, (ELEVATOR, named + damper), ("<flight_control", switch))

    return model(folder, "rascal", change)


def fuel(folder: Path) -> Path:
    """A third of its weight is fuel, behind the centre of gravity: the trim is that of full tanks."""
    tank = """</engine>
    <tank type="FUEL"><location unit="M"> <x> 0.03 </x> <y> 0 </y> <z> 0.1016 </z> </location>
      <capacity unit="KG"> 3 </capacity><contents unit="KG"> 3 </contents></tank>"""
    return model(folder, "rascal", lambda text: replaced(text, ("</engine>", tank)))


def reversed_signs(folder: Path) -> Path:
    """Elevator up and left wing down for positive commands, 20 deg of travel, no trim input."""

    def change(text: str) -> str:
        aileron = "<value> 0.5235987755982988 </value> <property> fcs/aileron-cmd-norm </property>"
        turned = ELEVATOR.replace("0.5235987755982988", "-0.35").replace(
            "<property> fcs/pitch-trim-cmd-norm </property>", "<value> 0 </value>"
        )
        return replaced(text, (ELEVATOR, turned), (aileron, aileron.replace("0.5235987755982988", "-0.35")))

    return model(folder, "rascal", change)


def inches(folder: Path) -> Path:
    """Feet, inches, pounds and slugs, and a file that says nothing of wheels."""

    def change(text: str) -> str:
        text = re.sub(r"<ground_reactions>.*?</ground_reactions>", "<ground_reactions/>", text, flags=re.S)
        text = re.sub(
            r'unit="M"> <x> (\S+) </x> <y> (\S+) </y> <z> (\S+) </z>',
            lambda m: 'unit="IN"> ' + " ".join(
                f"<{a}> {float(v) / 0.0254:.6g} </{a}>" for a, v in zip("xyz", m.groups(), strict=True)
            ),
            text,
        )  # fmt: skip
        return replaced(
            text,
            ('unit="M2"> 0.981985', 'unit="FT2"> 10.57'),
            ('unit="M"> 2.795016', 'unit="FT"> 9.17'),
            ('unit="M"> 0.35052', 'unit="IN"> 13.8'),
            ('unit="KG*M2"> 2.643845', 'unit="SLUG*FT2"> 1.95'),
            ('unit="KG*M2"> 2.101518', 'unit="SLUG*FT2"> 1.55'),
            ('unit="KG*M2"> 2.589612', 'unit="SLUG*FT2"> 1.91'),
            ('unit="KG"> 5.896701', 'unit="LBS"> 13'),
        )

    return model(folder, "rascal", change)


def norms(folder: Path) -> Path:
    """Aerodynamics by positions without a unit: no property tells a travel in rad."""

    def change(text: str) -> str:
        text = re.sub(r"fcs/(elevator|aileron|rudder)-pos-rad", r"fcs/\1-pos-norm", text)
        return re.sub(r"(-?)0\.5235987755982988", r"\g<1>1", text).replace("3.490658503988659", "7")

    return model(folder, "rascal", change)


def rate_command(folder: Path) -> Path:
    """Fly by wire: the stick commands a pitch rate, and an integrator holds it."""
    wired = """<fcs_function name="fbw/error"><function><difference>
        <property> velocities/q-rad_sec </property>
        <product> <value> 0.6 </value> <property> fcs/elevator-cmd-norm </property> </product>
      </difference></function></fcs_function>
      <pid name="fcs/elevator-cmd-rad"><input> fbw/error </input><kp> 0.4 </kp><ki> 1.0 </ki>
        <clipto> <min> -0.5 </min> <max> 0.5 </max> </clipto></pid>"""
    return model(folder, "rascal", lambda text: replaced(text, (ELEVATOR, wired)))


def unstable(folder: Path) -> Path:
    """Its neutral point lies ahead of its centre of gravity, as fighters have it."""
    old = "<product> <value> -0.5 </value> <property> aero/alpha-rad </property> </product>"
    return model(folder, "rascal", lambda text: replaced(text, (old, old.replace("-0.5", "0.2"))))


MODELS: dict[str, Callable[[Path], Path]] = {
    "elevons": elevons,
    "tail": tail,
    "v-tail": v_tail,
    "electric": electric,
    "own-control": own_control,
    "fuel": fuel,
    "reversed": reversed_signs,
    "inches": inches,
    "norms": norms,
    "rate-command": rate_command,
    "unstable": unstable,
}
