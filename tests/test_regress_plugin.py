"""The pytest plugin, in a project that is not this one."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from testbed.campaigns.job import Job
from testbed.regression import recording
from testbed.regression.plugin import FidelityBaseline
from testbed.regression.quantities import quantities
from testbed.regression.recording import record
from testbed.scenario.scenario import load

# The flights of that project cost nothing: aircraft come half a metre closer where the scenario says so.
CONFTEST = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_regress_plugin import scripted
from testbed.regression import recording
recording.fly = scripted
"""
TESTS = """
def test_x8(fidelity_baseline):
    fidelity_baseline.check("x8-head-on")

def test_of_a_change(fidelity_baseline):
    fidelity_baseline.check("x8-head-on", overrides=["d_safe_m=4"])

def test_mistaken(fidelity_baseline):
    fidelity_baseline.check("x8-hed-on")
"""


def scripted(job: Job) -> dict[str, float | None]:
    data = json.loads(job.data)
    row: dict[str, float | None] = {q.name: 0.0 for q in quantities(load("paper-2-turn"))}
    distance = 6.0 + 0.1 * np.random.default_rng(job.seed).normal()
    row["separation"] = distance - (0.5 if data["plant"] == "jsbsim" and data["d_safe_m"] < 5.0 else 0.0)
    return row


def test_another_project_is_checked_by_pytest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the entry point; a failure is the command's table, a mistake one line, neither a traceback."""
    monkeypatch.setattr(recording, "fly", scripted)
    record(tmp_path / "fidelity", "x8-head-on", "paper-2-turn", [], workers=1)
    (tmp_path / "pyproject.toml").write_text('[tool.testbed]\nbaselines = "fidelity"\n')
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_fidelity.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-q", "--rootdir", tmp_path, "--show-capture=no", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    said = done.stdout
    assert "2 failed, 1 passed" in said, said + done.stderr
    assert "x8-head-on: recorded seeds 1 to 20" in said
    assert "degraded: separation on 6-DOF" in said and "on 20 of 20 seeds" in said
    assert "no baseline 'x8-hed-on' in" in said and "did you mean x8-head-on?" in said
    assert "Traceback" not in said and "plugin.py" not in said


def test_a_project_without_baselines_is_told_how_to_begin(tmp_path: Path) -> None:
    with pytest.raises(pytest.fail.Exception, match="testbed regress record x8"):
        FidelityBaseline(tmp_path).check("x8")


def test_pytest_finds_the_plugin_and_starts_light() -> None:
    """Every project that has the testbed installed loads it at every start of pytest."""
    (found,) = [e for e in entry_points(group="pytest11") if e.name == "fidelity"]
    heavy = ("numpy", "pandas", "scipy", "pydantic", "jsbsim", "rich", "testbed.scenario.scenario")
    code = f"import pytest, sys, {found.value}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.strip() == "[]"
