"""The study of an airframe's assumptions changes what it says it changes, and nothing else."""

import pytest

from aircraft.airframe import load as airframe
from aircraft.airframes.schema import names
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import hold
from testbed.studies.sensitivity.sensitivity import CHANGES, Change, changed


@pytest.mark.parametrize("name", names())
def test_a_change_scales_inertia_and_thrust_by_its_factors(name, tmp_path) -> None:
    change = Change("", inertia=(0.7, 1.3, 0.9), thrust=0.8)
    before, after = (
        Fdm(a, 0.005, Origin()) for a in (airframe(name), changed(airframe(name), change, tmp_path / name))
    )
    given = {"fcs/throttle-cmd-norm": 0.7}
    for fdm in (before, after):
        hold(fdm, (18.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), given)

    def ratio(path: str) -> float:
        return after.read(path) / before.read(path)

    found = [ratio(f"inertia/i{a}-slugs_ft2") for a in ("xx", "yy", "zz")]
    assert found == pytest.approx(change.inertia, rel=1e-6)
    assert ratio("forces/fbx-external-lbs") == pytest.approx(0.8, rel=1e-6)
    assert ratio("inertia/mass-slugs") == 1.0
    assert after.airframe.gains == before.airframe.gains


@pytest.mark.parametrize("name", names())
def test_every_inertia_of_the_study_is_that_of_a_body(name) -> None:
    stated = airframe(name).stated
    for change in CHANGES:
        moments = [stated[f"j{axis}_kgm2"] * f for axis, f in zip("xyz", change.inertia, strict=True)]
        assert max(moments) < sum(moments) - max(moments), change


def test_a_model_without_a_marked_thrust_is_refused(tmp_path) -> None:
    x8 = airframe("x8")
    folder = tmp_path / "unmarked"
    copy = changed(x8, Change(""), folder)
    model = folder / "x8.xml"
    model.write_text(model.read_text().replace("<!-- C_prop -->", ""))
    with pytest.raises(ValueError, match="0 places match"):
        changed(copy, Change(""), tmp_path / "again")
