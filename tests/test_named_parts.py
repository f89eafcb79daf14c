"""A part that is named by text is found, its role told, its arguments checked; each mistake is one line."""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import testbed
from filters.model import State
from testbed.components import named_parts
from testbed.components.components import FIELDS, Parts
from testbed.components.named_parts import NamedPart, read
from testbed.errors import UserError

sys.path[:0] = [str(Path(__file__).parent)]
import own_code  # noqa: E402


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    own_code.write(tmp_path)
    monkeypatch.chdir(tmp_path)
    for name in ("helper", "slowpack", "slowpack.parts"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


def one(text: str) -> NamedPart:
    (found,) = read([text])
    return found


@pytest.mark.parametrize(
    ("text", "role", "label"),
    [
        ("mine.py:Slow", "filter", "Slow"),
        ("mine.py:Slow(share=0.5)", "filter", "Slow(share=0.5)"),
        (" mine.py:Slow( share = .5 ) ", "filter", "Slow(share=0.5)"),
        ("./mine.py:Straight", "guidance", "Straight"),
        ("mine.py:itself(share=0.5)", "filter", "itself(share=0.5)"),
        ("mine.py:later", "guidance", "later"),
        ("mine.py:made", "filter", "made"),
        ("mine.py:annotated(share=-1e-3)", "filter", "annotated(share=-0.001)"),
        ("filter=mine.py:unclear", "filter", "unclear"),
        ("mine.py:Told(anything=[1, (2, 'x')], other={'a': None})", "filter", None),
        ("mine.py:Air", "environment", "Air"),
        ("mine.py:Glider", "plant", "Glider"),
    ],
)
def test_the_role_is_told_by_what_the_name_is(here: Path, text: str, role: str, label: str | None) -> None:
    part = one(text)
    assert part.role == role and part.label == (label or part.label)
    assert list(Parts.of([part]).own()) == [FIELDS[role]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nowhere.py:Slow", "file nowhere.py does not exist"),
        ("min.py:Slow", "file min.py does not exist; did you mean mine.py?"),
        ("mine.py:Slaw", "mine.py has no 'Slaw'; did you mean Slow?"),
        ("mine.py:Nothing", "no part of any role: a filter has __call__(view, nominal, limits), guidance"),
        ("mine.py:GAIN", "it is an int, not a class or function"),
        ("mine.py:shared", "it is an object of class Slow, which runs would share; name the class"),
        ("mine.py:unclear", "what this function makes is not known; name the role"),
        (
            "mine.py:Untold",
            "it may be filter or guidance; name the role, for example --parts filter=mine.py:Untold",
        ),
        (
            "plant=mine.py:Slow",
            "as plant it lacks reset(), step(), state(), achieved(), telemetry(), faults()",
        ),
        ("filtre=mine.py:Slow", "no role 'filtre'; did you mean filter?"),
        ("mine.py:Slow(shore=1)", "takes no argument 'shore'; did you mean share?"),
        ("mine.py:later(gain=1)", "takes no argument 'gain'; it takes none"),
        ("guidance=mine.py:itself", "it needs view and nominal and limits"),
        ("mine.py:Slow(0.5)", "give arguments by name, for example NAME(gain=2)"),
        ("mine.py:Slow(**{})", "not by **"),
        ("mine.py:Slow(share=1, share=2)", "share is given twice"),
        ("mine.py:Slow(share=__import__('os').getpid())", "share is not a literal"),
        ("mine.py:Slow(share=1", "write FILE.py:NAME"),
        ("mine.py:Slow(share=1)(2)", "arguments cannot be read"),
        ("mine.py", "no part 'mine.py' is installed"),
        ("", "write FILE.py:NAME"),
        ("mine.py:", "write FILE.py:NAME"),
        ("x" * 5000, "longer than 4000 letters"),
        ("mine.py:Slow(share=" + "(" * 900 + ")" * 900 + ")", "arguments cannot be read"),
    ],
)
def test_a_mistake_is_one_line(here: Path, text: str, said: str) -> None:
    with pytest.raises(UserError) as refused:
        read([text])
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import numpy as np\nx = np.zeros(3) @\n", "bad.py, line 2: invalid syntax"),
        ("\nimport nowhere_to_be_found\n", "bad.py, line 2: importing it raised ModuleNotFoundError"),
        ("def f():\n    raise KeyError('k')\nf()\n", "bad.py, line 2: importing it raised KeyError: 'k'"),
        ("import sys\nsys.exit(3)\n", "bad.py, line 2: importing it raised SystemExit: 3"),
        ("from helper import NOTHING\n", "bad.py, line 1: importing it raised ImportError"),
        ("import json\njson.loads('{')\n", "bad.py, line 2: importing it raised JSONDecodeError"),
        ("X = 1\n", "bad.py has no 'Slow'; it defines no class and no function"),
    ],
)
def test_a_file_that_cannot_be_imported_is_named_with_its_line(here: Path, text: str, said: str) -> None:
    Path("bad.py").write_text(text)
    with pytest.raises(UserError, match="bad") as refused:
        read(["bad.py:Slow"])
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_files_that_are_none(here: Path) -> None:
    Path("folder.py").mkdir()
    Path("bytes.py").write_bytes(b"\x00\xff\x00")
    for name in ("folder", "bytes"):
        with pytest.raises(UserError, match=f"{name}.py"):
            read([f"{name}.py:Slow"])


def test_what_a_maker_names_it_is_given(here: Path) -> None:
    Path("who.py").write_text(
        "class Who:\n"
        "    def __init__(self, goal, /, gain, *, scenario, barrier=None, other=3):\n"
        "        self.given = goal, gain, scenario, barrier, other\n"
        "    def __call__(self, view, nominal, limits): ...\n"
    )
    part = one("who.py:Who(gain=[1], other='x')")
    made = part("the scenario", "the barrier", "the goal")
    assert made.given == ("the goal", [1], "the scenario", "the barrier", "x")
    # A list is each run's own.
    made.given[1].append(2)
    assert part("s", "b", "g").given[1] == [1] and part.label == "Who(gain=[1], other='x')"
    with pytest.raises(UserError, match=r"it needs gain: give 'who.py:Who\(gain=\.\.\.\)'"):
        read(["who.py:Who"])


def test_two_of_a_role_or_a_label(here: Path) -> None:
    named = read(["mine.py:Slow", "mine.py:Slow(share=0.5)"])
    with pytest.raises(UserError, match=r"Slow\(share=0.5\): Slow is the filter already; give one"):
        Parts.of(named)
    with pytest.raises(UserError, match=r"given twice"):
        read(["mine.py:Slow", "mine.py:Slow"])
    own_code.write(here, name="yours.py")
    assert [p.label for p in read(["mine.py:Slow", "yours.py:Slow"])] == ["mine.Slow", "yours.Slow"]


def test_names_are_split_at_commas_outside_arguments() -> None:
    text = "centralised, my.py:Cone(a=1, b=[2,3], c='x,y)'),none,"
    assert named_parts.split(text) == ["centralised", "my.py:Cone(a=1, b=[2,3], c='x,y)')", "none"]


def test_the_checksums_are_those_of_the_files(here: Path) -> None:
    origin = one("mine.py:Slow(share=0.5)").origin.to_json()
    sums = {n: hashlib.sha256(Path(n).read_bytes()).hexdigest() for n in ("mine.py", "helper.py")}
    assert origin == {
        "name": "mine.Slow",
        "file": "mine.py",
        "sha256": sums["mine.py"],
        "arguments": {"share": "0.5"},
        "imports": {"helper.py": sums["helper.py"]},
    }


def test_an_edited_file_is_read_again(here: Path) -> None:
    def speed() -> float:
        law = one("mine.py:Straight")(None, [0.0], None)
        state = State.of([[0.0, 0.0, 0.0, 0.0]])
        return float(law(0.0, state).v[0])

    assert speed() == 20.0
    own_code.write(here, speed=17.0)
    assert speed() == 17.0
    own_code.write(here, own_code.SMALL.replace("speed_mps=SPEED", "speed_mps=16.0"))
    assert speed() == 16.0


def test_a_helper_of_another_folder_is_not_taken_for_ones_own(here: Path) -> None:
    read(["mine.py:Slow"])
    own_code.write(here / "other", speed=1.0)
    with pytest.raises(
        UserError, match=r"imports helper, which stands beside it, but another module .* rename"
    ):
        read(["other/mine.py:Slow"])


def test_a_package_beside_the_file_travels_too(here: Path) -> None:
    package = here / "tools" / "deep"
    package.mkdir(parents=True)
    (here / "tools" / "__init__.py").write_text("from tools.deep.more import N\n")
    (package / "__init__.py").write_text("")
    (package / "more.py").write_text("N = 3\n")
    Path("uses.py").write_text(
        "def f():\n    import tools\n    return tools.N\n\nclass P:\n"
        "    def __call__(self, view, nominal, limits):\n        return f()\n"
    )
    part = one("uses.py:P")
    files = {"tools/__init__.py", "tools/deep/__init__.py", "tools/deep/more.py"}
    assert set(part.origin.imports) == files
    sent = pickle.dumps(part)
    for file in [*files, "uses.py"]:
        Path(file).unlink()
    text = f"import pickle; print(pickle.loads({sent!r})(None, None, None)(None, None, None))"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, cwd="/", check=True)
    assert done.stdout == "3\n"


def test_it_is_data_and_imports_the_same_elsewhere(here: Path) -> None:
    part = one("mine.py:Slow(share=0.5)")
    again = pickle.loads(pickle.dumps(part))
    assert again == part and again.origin == part.origin and hash(again) == hash(part)
    assert again(None, None, None).share == 0.5


def test_printing_on_import_stays_off_the_output(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("loud.py").write_text("print('hello')\nfrom mine import Slow\n")
    assert one("loud.py:Slow").role == "filter"
    said = capsys.readouterr()
    assert said.out == "" and "hello" in said.err


def test_an_installed_part_is_named_by_its_entry_point(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(own_code.install(here / "site")))
    part = one("slow-down(share=0.5)")
    assert (part.role, part.label) == ("filter", "slow-down(share=0.5)")
    assert part.origin.name == "slowpack.parts.Slow" and part.origin.package == "slowpack 1.2"
    for text, said in {
        "slow-dawn": "no part 'slow-dawn' is installed; did you mean slow-down?",
        "guidance=slow-down": "no guidance 'slow-down' is installed; known: straight",
        "environment=x": "no environment 'x' is installed; no package here offers any",
        "slow-down(gain=1)": "takes no argument 'gain'",
    }.items():
        with pytest.raises(UserError) as refused:
            read([text])
        assert said in str(refused.value)
    # Where the package has other sources, it is refused by name.
    sent = pickle.dumps(part)
    own_code.install(here / "site", text=own_code.SMALL + "\n# edited\n")
    text = f"import pickle; pickle.loads({sent!r})(None, None, None)"
    environment = os.environ | {"PYTHONPATH": str(here / "site")}
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, env=environment)
    assert "UserError: filter slow-down: package slowpack 1.2 has other sources here" in done.stderr


def test_a_scenario_names_installed_parts_and_no_files(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(own_code.install(here / "site")))
    settings = ["filter.kind=slow-down", "guidance.kind=straight", "duration_s=0.1"]
    scenario = testbed.load_scenario("paper-2-turn", settings)
    run = testbed.run(scenario)
    assert {k: v["name"] for k, v in run.manifest["parts"].items()} == {
        "filter": "slowpack.parts.Slow",
        "nominal": "slowpack.parts.Straight",
    }
    # What is given in person comes first.
    own = testbed.run(scenario, parts=Parts.of(read(["mine.py:itself"])))
    assert own.manifest["parts"]["filter"]["name"] == "mine.itself"
    for field, said in {
        "filter.kind=slow-dawn": "'none' or 'slow-down', got 'slow-dawn'",
        "guidance.kind=slow-down": "or 'straight', got 'slow-down'",
        "plant=mine.py:Glider": "'jsbsim' or 'brick', got 'mine.py:Glider'",
        "filter.kind=installed": "installed: 'slow-down'",
    }.items():
        with pytest.raises(UserError) as refused:
            testbed.load_scenario("paper-2-turn", [field])
        assert said in str(refused.value), str(refused.value)


def test_a_part_is_flown_behind_the_border(here: Path) -> None:
    """Whatever a named part does wrong ends the run with a fault that names it, as any own part."""
    Path("lies.py").write_text(
        "class Lies:\n    def __call__(self, view, nominal, limits):\n        return nominal\n"
    )
    scenario = testbed.load_scenario("paper-2-turn", ["duration_s=0.1"])
    run = testbed.run(scenario, parts=Parts.of(read(["lies.py:Lies"])))
    assert "filter lies.Lies: it returned a Command, not a Decision" in run.manifest["ended_early"]


def test_the_guides_cone_has_the_gradient_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np

    target = named_parts.read([f"{own_code.GUIDE}:Cone"])[0].target()
    barrier = target(testbed.load_scenario("paper-20-turn"), _Ds).filter.barrier
    rng, n = np.random.default_rng(20261127), 20
    fields = np.column_stack([rng.uniform(-60, 60, (n, 2)), rng.uniform(-4, 4, n), rng.uniform(-5, 5, n)])
    found = barrier.values(State.of(fields))
    lie_i, lie_j = found.lie(State.of(fields))
    gamma = barrier.manoeuvre(n).array()
    hdot = (lie_i * gamma[found.i]).sum(-1) + (lie_j * gamma[found.j]).sum(-1)
    # All fly straight on: no row whose h is not negative is lost. In closed form |w| (1 + p.w / (|w| s)).
    outside = found.h >= 0
    assert outside.sum() > 50 and hdot[outside].min() > -1e-9
    for p in range(0, len(found.h), 7):
        for k in range(8):
            vehicle = (found.i if k < 4 else found.j)[p]
            shifted = [fields.copy(), fields.copy()]
            for sign, moved in zip((1, -1), shifted, strict=True):
                moved[vehicle, k % 4] += sign * 1e-6
            up, down = (barrier.values(State.of(m)).h[p] for m in shifted)
            # Differences of 1e-6 have a round-off of 1e-9.
            assert abs((up - down) / 2e-6 - found.grad[p, k]) < 1e-6 * max(1.0, abs(found.grad[p, k]))


def test_the_guides_cone_says_whether_straight_flight_keeps_ds() -> None:
    """h >= 0 exactly where the smallest distance ever, by brute force, is at least Ds."""
    import numpy as np

    target = named_parts.read([f"{own_code.GUIDE}:Cone"])[0].target()
    barrier = target(testbed.load_scenario("paper-20-turn"), _Ds).filter.barrier
    rng, n = np.random.default_rng(20261128), 20
    fields = np.column_stack([rng.uniform(-60, 60, (n, 2)), rng.uniform(-4, 4, n), rng.uniform(-5, 5, n)])
    state = State.of(fields)
    found, v = barrier.values(state), barrier.manoeuvre(n).v
    velocity = v[:, None] * np.stack([np.cos(state.theta), np.sin(state.theta), 0 * state.z], -1)
    times = np.linspace(0.0, 600.0, 60_001)
    sure = 0
    for p, (i, j) in enumerate(zip(found.i, found.j, strict=True)):
        way = (state.position[j] - state.position[i]) + times[:, None] * (velocity[j] - velocity[i])
        least = np.linalg.norm(way, axis=-1).min()
        if np.linalg.norm(way[0]) > _Ds.d_safe and abs(least - _Ds.d_safe) > 0.05:
            sure += 1
            assert (found.h[p] >= 0) == (least > _Ds.d_safe)
    assert sure > 100


class _Ds:
    d_safe = 5.0
