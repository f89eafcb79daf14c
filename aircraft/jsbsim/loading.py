"""Loads an airframe's model into JSBSim: the only import of jsbsim.

Faults that JSBSim ignores, or on which it ends the process, are exceptions here.
"""

from __future__ import annotations

import ctypes
import shutil
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jsbsim

from aircraft.airframes.files import read_folder
from aircraft.airframes.references import unresolved
from aircraft.airframes.schema import AIRFRAMES, Airframe
from aircraft.equations.catalogue import compiled, of_airframe
from aircraft.jsbsim.errors import FdmError, UnresolvedError

Executive = jsbsim.FGFDMExec
Node = jsbsim.FGPropertyNode

# Fingerprints of the airframes whose references were checked in this process.
_resolved: set[str] = set()
_of_thread = threading.local()


class _Quiet(jsbsim.FGLogger):
    """Drops JSBSim's banner and notes and keeps its errors for our own messages."""

    def __init__(self) -> None:
        super().__init__()
        self.errors: list[str] = []
        self.place: tuple[str, int] | None = None  # file and line of the last message that has them
        self._level = jsbsim.LogLevel.INFO

    def set_level(self, level: jsbsim.LogLevel) -> None:
        self._level = level

    def message(self, message: str) -> None:
        if self._level.value >= jsbsim.LogLevel.ERROR.value:
            self.errors.append(message.strip())

    def file_location(self, filename: str, line: int) -> None:
        self.place = filename, line

    def format(self, format: jsbsim.LogFormat) -> None: ...

    def flush(self) -> None: ...


def load(airframe: Airframe, dt: float) -> Executive:
    """A JSBSim instance with this airframe's model, stepping every dt seconds.

    Engines and systems come from the airframe's folder only, but for the system of an autopilot that is
    compiled for this flight. JSBSim keeps the dt that it was loaded with.
    Raises  FdmError when the model is missing, malformed or without mass or wing; UnresolvedError when it
            refers to properties that do not exist, which JSBSim would answer later by aborting the process
    """
    folder, model = airframe.folder, airframe.model
    log = _logger()
    executive = jsbsim.FGFDMExec(None)
    executive.set_debug_level(0)
    executive.set_dt(dt)
    where = folder / f"{model}.xml"
    try:
        with _model(airframe, dt) as flown:
            loaded = executive.load_model_with_paths(
                model, str(flown), str(folder / "engine"), str(flown / "systems"), False
            )
    except RuntimeError as e:
        keep_for_ever(executive)
        messages = [str(e).strip(), *(said for said in log.errors if said != str(e).strip())]
        file, line = log.place or (None, None)
        if file and not file.startswith(str(folder)):  # of a copy
            file = str(next(folder.rglob(Path(file).name), where))
        at = f"{file}:{line}" if file else f"{where}"
        raise FdmError(f"{at}: {' '.join(' '.join(messages).split())}", file, line) from None
    if not loaded:
        keep_for_ever(executive)
        raise FdmError(f"{where} or a file that it names is missing: {' '.join(log.errors)}")
    try:
        _sizes(executive, where)
        _resolve(airframe, executive)
        _resolve_uses(airframe, executive)
    except FdmError:
        keep_for_ever(executive)
        raise
    return executive


@contextmanager
def _model(airframe: Airframe, dt: float) -> Iterator[Path]:
    """The folder of model and systems: the airframe's own, or a copy of it with the autopilot compiled now.

    JSBSim looks for systems beside the model first, wherever the path for systems leads.
    """
    folder = airframe.folder
    try:
        text = compiled(airframe, dt)
    except ValueError as error:
        raise FdmError(str(error)) from None
    if text is None:
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="airframe-") as name:
        made = Path(name)
        (made / "systems").mkdir()
        for file in (*folder.glob("*.xml"), *folder.glob("systems/*.xml")):
            if file.name != "autopilot.xml":
                shutil.copyfile(file, made / file.relative_to(folder))
        (made / "systems" / "autopilot.xml").write_text(text, encoding="utf-8")
        yield made


def _logger() -> _Quiet:
    """This thread's logger, without errors yet.

    JSBSim keeps a logger for each thread and releases it when the thread ends, without Python's lock: if that
    was the last reference, the process aborts.
    """
    log = getattr(_of_thread, "logger", None)
    if log is None:
        log = _of_thread.logger = _Quiet()
        # What it refers to is released in the same way.
        for thing in (log, *jsbsim.LogLevel, *jsbsim.LogFormat):
            keep_for_ever(thing)
        jsbsim.set_logger(log)
    log.errors.clear()
    log.place = None
    found: _Quiet = log
    return found


def keep_for_ever(thing: object) -> None:
    """Never delete it: the destructor of an instance whose model did not load may abort the process, say."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))


_SIZES = {
    "inertia/mass-slugs": "mass",
    "metrics/Sw-sqft": "<wingarea>",
    "metrics/bw-ft": "<wingspan>",
    "metrics/cbarw-ft": "<chord>",
}


def _sizes(executive: Executive, where: Path) -> None:
    """FdmError for a mass or a size by which nothing can be divided: JSBSim loads it, and flies NaN."""
    for path, name in _SIZES.items():
        if not (size := executive.get_property_value(path)) > 0.0:
            raise FdmError(f"{where}: its {name} is {size:g}: it must be above zero", where.name)


def _resolve(airframe: Airframe, executive: Executive) -> None:
    """UnresolvedError for a model that does not come with the package and refers to unknown properties."""
    if airframe.folder.parent == AIRFRAMES.resolve():
        return
    mark = airframe.fingerprint()
    if mark in _resolved:
        return
    manager = executive.get_property_manager()
    files, _ = read_folder(airframe.folder)
    if files is not None:
        findings = list(unresolved(files, lambda path: manager.get_node(path) is not None))
        if findings:
            raise UnresolvedError(airframe, findings)
    _resolved.add(mark)


def _resolve_uses(airframe: Airframe, executive: Executive) -> None:
    """FdmError for equations that use or drive properties which the model does not have."""
    if compiled(airframe) is None:
        return
    mine, manager = of_airframe(airframe), executive.get_property_manager()
    driven = {e.output: e.name for c in mine.channels for e in c.equations if e.output}
    for path, name in {**{path: name for name, path in mine.uses.items()}, **driven}.items():
        if manager.get_node(path) is None:
            raise FdmError(f"{airframe.name}: {name} of the autopilot: JSBSim has no property {path}")
