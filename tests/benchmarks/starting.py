"""How long Python takes until something is ready: the least of several fresh processes."""

from __future__ import annotations

import subprocess
import sys
import time


def seconds(arguments: list[str], goes: int = 7) -> float:
    """Wall time of `python ARGUMENTS`, the least of several."""
    best = float("inf")
    for _ in range(goes):
        began = time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
        best = min(best, time.perf_counter() - began)
    return best


def measure() -> dict[str, float]:
    """`testbed --help` and `import filters`, all of it, and of that what an empty Python takes [s]."""
    return {
        "help_s": seconds(
            ["-c", "import sys; sys.argv[1:] = ['--help']; from testbed.cli.main import main; main()"]
        ),
        "import_s": seconds(["-c", "import filters, filters.cbf.collision, filters.barriers.closed_form"]),
        "empty_s": seconds(["-c", ""]),
    }
