"""An airframe of your own: a Skywalker X8 with half a kilogram more to carry, in a folder that flies.

python docs/guide/examples/own_airframe.py my-wing
"""

import re
import sys
from pathlib import Path

import testbed
from aircraft import airframe
from aircraft.autopilots import remaking

MASS_KG = 3.864


def change(file: Path, pattern: str, replacement: str) -> None:
    """Replace all that matches; something must."""
    text, count = re.subn(pattern, replacement, file.read_text(), flags=re.M)
    assert count, f"{file}: no {pattern}"
    file.write_text(text)


if __name__ == "__main__":
    folder = airframe.copy("x8", Path(sys.argv[1]))
    # The model; and what airframe.toml knows of it: the autopilot's feed-forward, and what `check` compares.
    change(folder / "x8.xml", r'(<emptywt unit="KG">) .* (</emptywt>)', rf"\1 {MASS_KG} \2")
    change(folder / "airframe.toml", r"^mass_kg = [\d.]+", f"mass_kg = {MASS_KG}")
    # Feed-forward fitted to its own level trims, the autopilot that has the gains in it, and lags: what
    # `testbed aircraft trim`, `autopilot` and `identify` write.
    for remade in (remaking.remade_feedforward, remaking.remade_autopilot, remaking.remade_lags):
        remade(airframe.load(folder)).write()

    settings = ["plant=jsbsim", "lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05", "duration_s=10"]
    for name in ("x8", str(folder)):
        scenario = testbed.load_scenario("paper-2-turn", [*settings, f"airframes=['{name}']"])
        separation = testbed.run(scenario).guarantee("separation")
        print(f"{name}: separation {separation['verdict']}, {separation['value']:.2f} m")
