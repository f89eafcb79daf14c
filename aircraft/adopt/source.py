"""Finds a JSBSim aircraft and the files that it consists of: its own folder's first, then JSBSim's."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from aircraft.adopt.failures import AdoptionError
from aircraft.airframes.xml import Element, RefusedError, read

STAGE = "files"


def wheel() -> Path:
    """The folder of JSBSim's own aircraft, engines and systems."""
    found = importlib.util.find_spec("jsbsim")
    assert found is not None and found.origin is not None
    return Path(found.origin).parent


def stock() -> list[str]:
    """The names of the aircraft that come with JSBSim."""
    folders = sorted(p for p in (wheel() / "aircraft").iterdir() if p.is_dir())
    return [p.name for p in folders if (p / f"{p.name}.xml").is_file()]


@dataclass(frozen=True)
class Source:
    """A model's file, and where the files that it names are looked for, in this order."""

    name: str
    model: Path
    folders: tuple[Path, ...]

    def locate(self, name: str, kind: str) -> Path | None:
        """The file that a <system>, <engine> or <thruster> names; None if there is none."""
        stem = name.removesuffix(".xml") + ".xml"
        for folder in self.folders:
            for below in _BELOW[kind]:
                path = folder / below / stem
                if path.is_file():
                    return path
        return None


_BELOW = {
    "system": ("Systems", "systems", "", "engine"),
    "engine": ("Engines", "engines", "Engine", "engine", ""),
    "section": ("", "Systems", "systems"),
}


def find(name_or_path: str) -> Source:
    """A stock aircraft by name, a folder with one model, or a model's file.

    Raises  AdoptionError
    """
    path = Path(name_or_path).expanduser()
    if not path.exists():
        if name_or_path in stock():
            path = wheel() / "aircraft" / name_or_path
        else:
            near = get_close_matches(name_or_path.lower(), stock(), 3, 0.5)
            known = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(stock())}"
            raise AdoptionError(
                STAGE, f"there is no folder {name_or_path}, and no aircraft of JSBSim of that name; {known}"
            )
    model = path if path.is_file() else _model_in(path)
    folder = model.resolve().parent
    root = folder.parent.parent if folder.parent.name == "aircraft" else folder.parent
    around = (folder, root, wheel()) if _is_root(root) else (folder, wheel())
    return Source(model.stem, model.resolve(), tuple(dict.fromkeys(around)))


def _is_root(folder: Path) -> bool:
    """Whether a folder holds engines or systems for the aircraft below it, as a JSBSim installation does."""
    return any((folder / name).is_dir() for name in ("engine", "systems"))


def _model_in(folder: Path) -> Path:
    models = list(_models(folder))
    named = [p for p in models if p.stem.lower() == folder.resolve().name.lower()]
    if len(named) == 1 or len(models) == 1:
        return (named or models)[0]
    if not models:
        raise AdoptionError(STAGE, f"{folder} holds no XML file that begins with <fdm_config>")
    listed = ", ".join(p.name for p in models)
    raise AdoptionError(STAGE, f"{folder} holds several models: {listed}; name the file of one")


def _models(folder: Path) -> Iterator[Path]:
    try:
        files = sorted(folder.glob("*.xml"))
    except OSError as error:
        raise AdoptionError(STAGE, f"{folder} cannot be read: {error.strerror}") from None
    broken: AdoptionError | None = None
    found = False
    for path in files:
        try:
            tree = read(path, skip_document_type=True)
        except RefusedError as error:
            broken = broken or refused(path, error)
            continue
        if tree.name == "fdm_config":
            found = True
            yield path
    if not found and broken is not None:
        raise broken


def refused(path: Path, error: RefusedError) -> AdoptionError:
    """An XML file that cannot be read."""
    line = "" if error.line is None else f":{error.line}"
    return AdoptionError(STAGE, f"{path.name}{line}: {error}")


def parse(path: Path) -> Element:
    """The root of an XML file, its document type skipped. Raises AdoptionError."""
    try:
        return read(path, skip_document_type=True)
    except RefusedError as error:
        raise refused(path, error) from None
