"""Splits what names an airframe: its folder, and the autopilot asked for after an @."""

from __future__ import annotations

import os
from pathlib import Path


def split(name_or_folder: str | Path) -> tuple[str, tuple[str, ...]]:
    """What names an airframe, and what follows it: "x8@arduplane" is x8 under another autopilot."""
    text = str(name_or_folder)
    if Path(os.path.expanduser(text)).exists():  # a folder somewhere below one with an @ in its name
        return text, ()
    at = text.find("@", text.rfind("/") + 1)
    return (text, ()) if at < 1 else (text[:at], tuple(text[at + 1 :].split("@")))
