"""The structure the design binds: folder order, no import circles, one home per dependency, module size."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import aircraft
import filters
import testbed
from tests import structure

ROOT = Path(__file__).parent.parent
PACKAGES = {"filters": filters, "aircraft": aircraft, "testbed": testbed}

# From the ground up: a folder (or module beside the folders) imports only what stands before it, and a
# package only what its predecessors and itself hold.
ORDER = {
    "filters": ["model", "constraints", "barriers", "filter", "qp", "cbf", "flow", "wrappers", "rivals"],
    "aircraft": [
        "textfile",
        "plant",
        "kinematic",
        "replay",
        "airframes",
        "equations",
        "jsbsim",
        "autopilots",
        "airframe",
        "logs",
        "datasheets",
        "check",
        "adopt",
    ],
    "testbed": [
        "errors",
        "statistics",
        "rare_events",
        "scenario",
        "records",
        "environment",
        "components",
        "encounters",
        "measures",
        "claims",
        "requirements",
        "verification",
        "simulation",
        "gym",
        "campaigns",
        "report",
        "export",
        "studies",
        "regression",
        "cli",
    ],
}
# What aircraft may take from filters.
FILTERS_FOR_AIRCRAFT = {"filters.model"}
# A dependency is imported only in these files and folders.
HOMES = {
    "jsbsim": ["aircraft/jsbsim/loading.py"],
    "osqp": ["filters/qp/"],
    "daqp": ["filters/qp/"],
    "control": ["aircraft/autopilots/"],
    "pymavlink": ["aircraft/logs/ardupilot.py"],
    "pyulog": ["aircraft/logs/px4.py"],
    "distributed": ["testbed/campaigns/cluster.py"],
    "dask": ["testbed/campaigns/cluster.py"],
    "gymnasium": ["testbed/gym/"],
    "pettingzoo": ["testbed/gym/fleet.py"],
    "jinja2": ["testbed/report/"],
    "markupsafe": ["testbed/report/"],
    "matplotlib": ["testbed/report/", "testbed/studies/"],
    "pyarrow": ["testbed/records/", "testbed/campaigns/tables.py", "testbed/verification/recorded.py"],
    "pydantic": [
        "aircraft/airframes/",
        "testbed/scenario/",
        "testbed/campaigns/file.py",
        "testbed/studies/benchmark/file.py",
    ],
    "pytest": ["testbed/regression/plugin.py"],
    "typer": ["testbed/cli/"],
}
MOST_LINES = 300


@pytest.fixture(scope="module")
def modules() -> dict[str, structure.Module]:
    return structure.read(ROOT, list(PACKAGES))


@pytest.mark.parametrize("package", PACKAGES)
def test_the_imported_package_is_this_projects(package: str) -> None:
    assert Path(PACKAGES[package].__file__ or "").parent == ROOT / package


def test_folders_import_only_what_stands_before_them(modules: dict[str, structure.Module]) -> None:
    wrong = structure.wrong_arrows(modules, ORDER)
    assert [f"{arrow.importer} -> {arrow.imported}" for arrow in wrong] == []


def test_aircraft_takes_only_the_model_from_filters(modules: dict[str, structure.Module]) -> None:
    taken = {
        arrow.imported
        for module in modules.values()
        if module.parts[0] == "aircraft"
        for arrow in module.imports
        if arrow.imported.startswith("filters")
    }
    assert taken == FILTERS_FOR_AIRCRAFT


def test_no_circle_between_modules_or_folders(modules: dict[str, structure.Module]) -> None:
    assert set(structure.circular_imports(modules)) == set()


def test_a_dependency_has_one_home(modules: dict[str, structure.Module]) -> None:
    assert not structure.away_from_home(modules, ROOT, HOMES)
    used = frozenset().union(*(module.outside for module in modules.values()))
    assert used >= HOMES.keys() - {"dask"}, "HOMES names a dependency that nothing imports"


def test_no_module_is_too_long(modules: dict[str, structure.Module]) -> None:
    long = {
        module.path.relative_to(ROOT).as_posix()
        for module in modules.values()
        if len(module.path.read_text(encoding="utf-8").splitlines()) > MOST_LINES
    }
    assert long == set()


def test_testbed_has_no_loose_module() -> None:
    assert {file.name for file in (ROOT / "testbed").glob("*.py")} == {"__init__.py", "errors.py"}


def test_every_module_says_in_its_first_line_what_it_does(modules: dict[str, structure.Module]) -> None:
    silent = set()
    for module in modules.values():
        tree = ast.parse(module.path.read_text(encoding="utf-8"))
        first = (ast.get_docstring(tree) or "").partition("\n")[0]
        if tree.body and not (first.endswith((".", ":")) and len(first) > 15):
            silent.add(module.path.relative_to(ROOT).as_posix())
    assert silent == set()


def test_nobody_uses_the_private_names_of_another_module(modules: dict[str, structure.Module]) -> None:
    files = [module.path for module in modules.values()] + sorted((ROOT / "tests").rglob("*.py"))
    used = {file.relative_to(ROOT).as_posix(): structure.private_names(file) for file in files}
    found = {f"{file} {name}" for file, names in used.items() for name in names}
    assert found == set()


def test_feet_stay_in_the_flight_dynamics_wrapper(modules: dict[str, structure.Module]) -> None:
    for module in modules.values():
        if module.path.name not in ("fdm.py", "geodesy.py"):
            assert "0.3048" not in module.path.read_text(encoding="utf-8"), f"{module.path} converts feet"


@pytest.mark.parametrize("module", ["filters.cbf.collision", "testbed.cli.main"])
def test_importing_is_light(module: str) -> None:
    """Solvers, aircraft and plotting load at first use, so that --help is quick."""
    heavy = ("osqp", "daqp", "jsbsim", "control", "matplotlib", "pandas")
    code = f"import sys, {module}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.strip() == "[]"


# The checker itself, on made-up trees.

SMALL_ORDER = {"low": ["ground", "walls"], "high": ["roof", "flag"]}
SMALL = {
    "low/__init__.py": "",
    "low/ground.py": "import math\n",
    "low/walls/__init__.py": "",
    "low/walls/brick.py": "from low import ground\n",
    "low/walls/mortar.py": "from low.walls.brick import size\n",
    "high/__init__.py": "from high.flag import colour\n",
    "high/roof.py": "import low.walls.mortar as mortar\n",
    "high/flag.py": "from high import roof\n",
}


def made_up(root: Path, **changed: str) -> dict[str, structure.Module]:
    """The small tree with some files' texts replaced; keys are paths with "__" for "/" and no ending."""
    replaced = {key.replace("__", "/") + ".py": text for key, text in changed.items()}
    for path, text in (SMALL | replaced).items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")
    return structure.read(root, list(SMALL_ORDER))


def test_a_sound_tree_has_no_offence(tmp_path: Path) -> None:
    tree = made_up(tmp_path)
    assert structure.wrong_arrows(tree, SMALL_ORDER) == []
    assert structure.circular_imports(tree) == []
    assert structure.away_from_home(tree, tmp_path, {"math": ["low/ground.py"]}) == []


@pytest.mark.parametrize(
    "text",
    [
        "from low.walls import brick\n",
        "def f():\n    import low.walls.brick\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from low.walls.brick import size\n",
        "import importlib\ndef f():\n    return importlib.import_module('low.walls.brick')\n",
    ],
    ids=["plain", "in a function", "for types only", "by its name"],
)
def test_a_turned_arrow_is_found_however_it_is_written(tmp_path: Path, text: str) -> None:
    tree = made_up(tmp_path, low__ground=text)
    wrong = structure.wrong_arrows(tree, SMALL_ORDER)
    assert [(arrow.importer, arrow.imported) for arrow in wrong] == [("low.ground", "low.walls.brick")]
    assert structure.circular_imports(tree) == ["low: ground -> walls", "low: walls -> ground"]


def test_an_import_of_a_higher_package_is_found(tmp_path: Path) -> None:
    tree = made_up(tmp_path, low__walls__mortar="from high.roof import tile\n", high__roof="")
    wrong = structure.wrong_arrows(tree, SMALL_ORDER)
    assert [(arrow.importer, arrow.imported) for arrow in wrong] == [("low.walls.mortar", "high.roof")]


def test_an_import_of_the_front_door_is_found(tmp_path: Path) -> None:
    tree = made_up(tmp_path, high__roof="from high import colour\n")
    wrong = structure.wrong_arrows(tree, SMALL_ORDER)
    assert [(arrow.importer, arrow.imported) for arrow in wrong] == [("high.roof", "high")]


def test_a_circle_of_two_modules_in_one_folder_is_found(tmp_path: Path) -> None:
    tree = made_up(tmp_path, low__walls__brick="def f():\n    from low.walls import mortar\n")
    assert structure.circular_imports(tree) == [
        "low/walls: brick -> mortar",
        "low/walls: mortar -> brick",
    ]


def test_folders_that_import_each_other_are_a_circle_though_no_two_modules_are(tmp_path: Path) -> None:
    extra = {"low__doors__panel": "from low.walls import mortar\n", "low__doors__knob": ""}
    tree = made_up(tmp_path, **extra, low__walls__brick="from low.doors import knob\n")
    assert structure.circular_imports(tree) == ["low: doors -> walls", "low: walls -> doors"]


def test_a_longer_circle_is_found_and_what_only_leads_to_it_is_not(tmp_path: Path) -> None:
    extra = {f"low__walls__{a}": f"from low.walls import {b}\n" for a, b in ("ab", "bc", "ca", "da")}
    assert structure.circular_imports(made_up(tmp_path, **extra)) == [
        "low/walls: a -> b",
        "low/walls: b -> c",
        "low/walls: c -> a",
    ]


def test_a_folder_without_a_place_is_refused(tmp_path: Path) -> None:
    tree = made_up(tmp_path, low__cellar__wine="from low import ground\n")
    with pytest.raises(ValueError, match=r"low/cellar has no place"):
        structure.wrong_arrows(tree, SMALL_ORDER)


def test_a_relative_import_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"brick.py:1: relative import"):
        made_up(tmp_path, low__walls__brick="from . import mortar\n")


def test_a_dependency_away_from_home_is_found(tmp_path: Path) -> None:
    tree = made_up(tmp_path, high__flag="def f():\n    import math.special\n")
    found = structure.away_from_home(tree, tmp_path, {"math": ["low/"]})
    assert found == [("math", "high/flag.py")]


def test_private_names_of_others_are_found(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text(
        "from b import _c\nimport os\n"
        "class D:\n    def __init__(self, other):\n        self._e = other._e + other._f\n"
        "    def __eq__(self, other):\n        return self.__class__ == other.__class__\n"
    )
    assert structure.private_names(file) == ["_c (1)", "_f (5)"]
