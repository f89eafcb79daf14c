"""Writes flights as ArduPilot and PX4 log them, field by field, for the tests of the log readers."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

G = 9.80665
_LENGTHS = {"Q": 8, "f": 4, "B": 1, "n": 4, "N": 16, "Z": 64}
_CODES = {"Q": "Q", "f": "f", "B": "B", "n": "4s", "N": "16s", "Z": "64s"}
_HEAD = b"\xa3\x95"


def dataflash(path: Path, messages: Mapping[str, tuple[str, str, Sequence[Sequence[float]]]]) -> None:
    """A DataFlash log. messages: name -> (format, comma-separated columns, rows); rows begin with TimeUS."""
    kinds = {name: 129 + k for k, name in enumerate(messages)}
    out = bytearray(_fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))
    for name, (form, columns, _) in messages.items():
        out += _fmt(kinds[name], name, form, columns)
    rows = [(row[0], name, row) for name, (_, _, each) in messages.items() for row in each]
    for _, name, row in sorted(rows, key=lambda r: r[0]):
        form = messages[name][0]
        out += _HEAD + bytes([kinds[name]])
        out += struct.pack("<" + "".join(_CODES[c] for c in form), *_typed(form, row))
    path.write_bytes(out)


def _typed(form: str, row: Sequence[float]) -> list[float | int]:
    return [int(x) if c in "QB" else float(x) for c, x in zip(form, row, strict=True)]


def _fmt(kind: int, name: str, form: str, columns: str) -> bytes:
    length = 3 + sum(_LENGTHS[c] for c in form)
    packed = struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode())
    return _HEAD + bytes([128]) + packed


def ulog(path: Path, topics: Mapping[str, tuple[Mapping[str, int], Mapping[str, np.ndarray]]]) -> None:
    """A ULog file of float topics. topics: name -> (field -> length of its array, 1 a plain float), columns.

    Columns are named as readers name them, `q[0]`, with `timestamp` in us.
    """
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))
    out += _ulog_message("B", bytes(40))
    for name, (fields, _) in topics.items():
        listed = "".join(f"float{f'[{n}]' if n > 1 else ''} {f};" for f, n in fields.items())
        out += _ulog_message("F", f"{name}:uint64_t timestamp;{listed}".encode())
    rows = []
    for k, (name, (fields, columns)) in enumerate(topics.items()):
        out += _ulog_message("A", struct.pack("<BH", 0, k) + name.encode())
        names = [g for f, n in fields.items() for g in ([f] if n == 1 else [f"{f}[{i}]" for i in range(n)])]
        values = np.stack([columns[g] for g in names], axis=-1).astype("<f4")
        for t, row in zip(columns["timestamp"], values, strict=True):
            rows.append((int(t), struct.pack("<HQ", k, int(t)) + row.tobytes()))
    for _, row in sorted(rows, key=lambda r: r[0]):
        out += _ulog_message("D", row)
    path.write_bytes(out)


def _ulog_message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def quaternion(roll: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """From north-east-down to the body without pitch, (k, 4)."""
    a, b = roll / 2, yaw / 2
    return np.stack(
        [np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a) * np.sin(b)], axis=-1
    )
