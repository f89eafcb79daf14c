"""What several test files share."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from testbed.cli import main


def pytest_configure() -> None:
    """Signals as a terminal's programs have them: what is started in the background may inherit them ignored,
    and pass that on to the programs the tests start."""
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, handler)


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """`testbed` with these arguments, in this process; its exit code."""

    def command(*arguments: object) -> int:
        monkeypatch.setattr(sys, "argv", ["testbed", *map(str, arguments)])
        try:
            main.main()
        except SystemExit as end:
            return int(end.code or 0)
        return 0

    return command


@pytest.fixture
def refusal(
    call: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Callable[..., str]:
    """What `testbed` says on stderr of arguments it refuses, in an empty folder where it leaves nothing."""

    def command(*arguments: object) -> str:
        monkeypatch.chdir(tmp_path)
        assert call(*arguments) == 2
        assert list(tmp_path.iterdir()) == []
        return capsys.readouterr().err

    return command
