"""An airframe folder as text: its files, read without trusting them, and what a linter finds in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from aircraft.airframes.reading import AirframeFileError, read_airframe
from aircraft.airframes.schema import Airframe
from aircraft.airframes.xml import Element, RefusedError, read
from aircraft.textfile import line_of, read_text


@dataclass(frozen=True)
class Finding:
    """One thing to mend. A warning flies, but is implausible."""

    rule: str
    severity: str  # error or warning
    file: str  # below the folder
    line: int | None
    message: str
    remedy: str

    def __str__(self) -> str:
        where = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{where}: {self.severity} [{self.rule}]: {self.message}; {self.remedy}"


@dataclass
class Files:
    """The folder as read: root elements by path below it, the model's own first."""

    folder: Path
    airframe: Airframe
    trees: dict[str, Element]

    @property
    def model(self) -> str:
        return f"{self.airframe.model}.xml"

    def elements(self, name: str) -> Iterator[tuple[str, Element]]:
        return ((file, e) for file, tree in self.trees.items() for e in tree.all(name))


# Elements that name a file, and where it must lie.
PLACES = {"system": "systems", "autopilot": "systems", "engine": "engine", "thruster": "engine"}


def read_folder(folder: Path) -> tuple[Files | None, list[Finding]]:
    """The files of an airframe, followed from airframe.toml, and what is wrong with reading them."""
    toml = "airframe.toml"
    if not (folder / toml).is_file():
        remedy = "copy an airframe and edit it: testbed aircraft copy x8 FOLDER"
        if any(folder.glob("*.xml")):
            remedy = f"make an airframe of this model: testbed aircraft adopt {folder}"
        return None, [Finding("files", "error", toml, None, "does not exist", remedy)]
    try:
        airframe = read_airframe(folder)
    except AirframeFileError as error:
        remedy = f"correct {error.key}" if error.key else "correct this line"
        return None, [Finding("airframe.toml", "error", toml, error.line, error.message, remedy)]
    files, findings = Files(folder.resolve(), airframe, {}), []
    waiting: list[tuple[str, str, int | None]] = [(files.model, toml, toml_line(folder / toml, "model"))]
    while waiting:
        name, by, line = waiting.pop(0)
        if name in files.trees:
            continue
        path = (files.folder / name).resolve()
        if not path.is_relative_to(files.folder):
            message = f"{name} is outside the folder"
            findings.append(
                Finding("refused", "error", by, line, message, "keep every file below the folder")
            )
            continue
        if not path.is_file():
            findings.append(
                Finding("files", "error", by, line, f"{name} does not exist", "add it or correct its name")
            )
            continue
        try:
            tree = read(path)
        except RefusedError as error:
            rule = "xml" if "well-formed" in str(error) else "refused"
            findings.append(Finding(rule, "error", name, error.line, str(error), "correct the file"))
            continue
        files.trees[name] = tree
        for kind, place in PLACES.items():
            for e in tree.all(kind):
                if "file" in e.attributes:
                    stem = e.attributes["file"].removesuffix(".xml")
                    waiting.append((f"{Path(place) / stem}.xml", name, e.line))
    return files, findings


def toml_line(path: Path, key: str) -> int | None:
    """The line of a TOML file that says a dotted key, gains.turn.damping, or that of its nearest table."""
    try:
        text, parts = read_text(path), key.split(".")
    except (OSError, ValueError):
        return None
    found = (line_of(text, parts[:n]) for n in range(len(parts), 0, -1))
    return next((line for line in found if line is not None), None)
