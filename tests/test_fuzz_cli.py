"""The command line from a fuzzer: exit code 0 and a whole run folder, or 2, one line, and nothing left."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import testbed
from testbed.cli import main
from tests.fuzzing import TEXT, cases, no_hang

WORDS = st.one_of(
    TEXT,
    st.sampled_from(
        ["--", "-", "--help", "--json", "-1", "0", "1e9", "nan", "true", "[", "a=b", "x" * 300, "x" * 5000]
    ),
    st.sampled_from(
        ["--out=r", "--overwrite", "--force", "--seed=7", "--seed=nan", "--plant=lagged", "--plant=\u00e9"]
    ),
    st.sampled_from(
        ["--set=vehicles=1", "--set=d_safe_m=nan", "--set=name=[b]", "--set=places=[{}]", "--set=="]
    ),
)  # fmt: skip
# A scenario that is none keeps commands that fly for hours from flying.
COMMANDS = [
    ["run", "paper-2-turn", "--set=duration_s=0.005", "--set=checks.manoeuvre_instants=0"],
    ["run", "paper-motivating", "--set=duration_s=0", "--set=checks.manoeuvre_instants=0"],
    ["compare", "none", "--plants=unicycle"], ["remedies", "none"], ["margin", "none"], ["figures"],
    ["answer", "--vehicles=x"], ["tune", "none"], ["list"], ["schema"], ["aircraft", "list"],
    ["aircraft", "check"], ["aircraft", "describe", "none"], ["report", "none"], ["export", "none"],
    ["campaign", "run", "none"], ["campaign", "status", "none"], ["ledger", "none"], ["falsify", "none"],
    ["verify", "none"], [],
]  # fmt: skip


@given(st.sampled_from(COMMANDS), st.lists(WORDS, max_size=4))
@cases(160)
def test_any_command_line_is_answered(
    tmp_path_factory: pytest.TempPathFactory, command: list[str], words: list[str]
) -> None:
    here = tmp_path_factory.mktemp("cli")
    if command[:1] == ["figures"]:
        words = [f"--set={word}" for word in words] + ["--out=f", "--plant=none"]
    said, told = io.StringIO(), io.StringIO()
    before, arguments = Path.cwd(), sys.argv
    code = 0
    try:
        os.chdir(here)
        sys.argv = ["testbed", *command, *words]
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told), no_hang():
            main.main()
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os.chdir(before)
        sys.argv = arguments
    error = told.getvalue()
    assert "Traceback" not in error
    # 1 is what `aircraft check` says of findings
    assert code in ((0, 1, 2) if command[:2] == ["aircraft", "check"] else (0, 2)), (code, error)
    left = list(here.rglob("*"))
    if code == 2:
        assert not left, left
        assert len([line for line in error.splitlines() if line.lower().startswith("error")]) == 1 or (
            "Usage" in error + said.getvalue()
        ), error
    assert not [path for path in left if ".partial" in path.name]
    for manifest in here.rglob("manifest.json"):
        assert len(testbed.load(manifest.parent).vehicles) > 0
