"""How long a thousand encounters take from one file to a thousand scenario files:
python -m benchmarks.encounters, in tests/. No test: it is wall time, and depends on the machine."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from testbed.encounters.importing import read
from testbed.encounters.scenarios import Choices
from testbed.encounters.writing import write

COUNT, ROWS = 1000, 60


def file(folder: Path, count: int = COUNT) -> Path:
    """A table of `count` encounters of two aircraft, a row a second each."""
    rng = np.random.default_rng(1)
    lines = ["encounter aircraft time_s east_ft north_ft alt_ft track_deg gs_kt vertical_rate_fpm"]
    for number in range(1, count + 1):
        for aircraft in (1, 2):
            track, speed = rng.uniform(0, 360), rng.uniform(80, 160)
            east, north = rng.uniform(-20_000, 20_000, 2)
            course, feet = np.radians(90 - track), speed * 1852 / 3600 / 0.3048
            for t in range(ROWS):
                x, y = east + feet * np.cos(course) * t, north + feet * np.sin(course) * t
                lines.append(
                    f"{number} {aircraft} {t} {x:.2f} {y:.2f} {3000 + 2 * t} {track:.3f} {speed:.2f} 120.0"
                )
    path = folder / "thousand.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def measure() -> dict[str, float]:
    """Seconds to read the file, and to check and write its scenarios."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = file(folder)
        began, cpu = time.perf_counter(), time.process_time()
        found = read([source], "table")
        read_ = time.perf_counter()
        write(found, Choices(), folder / "out", "benchmark")
        return {
            "encounters": len(found),
            "megabytes": source.stat().st_size / 1e6,
            "read_s": read_ - began,
            "write_s": time.perf_counter() - read_,
            "processor_s": time.process_time() - cpu,
        }


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:12} {value:.2f}")
