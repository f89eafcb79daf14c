"""The structure the design binds: which package may import which, and one home for each dependency."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import aircraft
import filters
import testbed

ROOT = Path(__file__).parent.parent
PACKAGES = {"filters": filters, "aircraft": aircraft, "testbed": testbed}
MAY_IMPORT = {
    "filters": {"filters"},
    "aircraft": {"aircraft", "filters.model"},
    "testbed": {"testbed", "aircraft", "filters"},
}
HOMES = {
    "jsbsim": {"aircraft/jsbsim/fdm.py"},
    "osqp": {"filters/qp/single.py"},
    "daqp": {"filters/qp/active_set.py"},
    "control": {"aircraft/jsbsim/trim.py", "aircraft/autopilots/margins.py", "aircraft/autopilots/tuning.py"},
}


def imports(file: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{file}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", PACKAGES)
def test_the_imported_package_is_this_projects(package: str) -> None:
    assert Path(PACKAGES[package].__file__ or "").parent == ROOT / package


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_point_one_way(package: str) -> None:
    for file in modules(package):
        for name in imports(file):
            if name.split(".")[0] in PACKAGES:
                allowed = any(name == a or name.startswith(a + ".") for a in MAY_IMPORT[package])
                assert allowed, f"{file.relative_to(ROOT)} imports {name}"


@pytest.mark.parametrize("dependency", HOMES)
def test_a_dependency_has_one_home(dependency: str) -> None:
    users = {
        str(file.relative_to(ROOT))
        for package in PACKAGES
        for file in modules(package)
        if any(name.split(".")[0] == dependency for name in imports(file))
    }
    assert users <= HOMES[dependency], f"{dependency} is imported by {users - HOMES[dependency]}"


def test_feet_stay_in_the_flight_dynamics_wrapper() -> None:
    for package in PACKAGES:
        for file in modules(package):
            if file.name not in ("fdm.py", "geodesy.py"):
                text = file.read_text(encoding="utf-8")
                assert "0.3048" not in text, f"{file.relative_to(ROOT)} converts feet"


@pytest.mark.parametrize("module", ["filters.cbf.collision", "testbed.cli.main"])
def test_importing_is_light(module: str) -> None:
    """Solvers, aircraft and plotting load at first use, so that --help is quick."""
    heavy = ("osqp", "daqp", "jsbsim", "control", "matplotlib", "pandas")
    code = f"import sys, {module}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.strip() == "[]"
