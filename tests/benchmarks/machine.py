"""What the numbers were made on: the processor and the versions, no names or places."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from benchmarks.caches import second_level
from testbed.components.versions import versions


def describe() -> dict[str, Any]:
    """Processor, cores, operating system, load and versions."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "load": round(load, 1),
        "cache_kb": second_level() // 1024,
        "versions": versions(),
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
