"""Packs work, jobs and answers for the pipe to another process, and says clearly what cannot be sent.

Work is sent by name. A function of the script that was started is sent with that script's path, and the
worker imports the script, as multiprocessing does.
"""

from __future__ import annotations

import pickle
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from testbed.errors import UserError

# The name under which workers import the script that was started; its `if __name__ == "__main__":` stays out.
MAIN = "__mp_main__"
# Whether this process, a worker, is importing that script.
_importing = False
BY_NAME = "give a function defined at the top level of a module"
PLAIN = "make jobs and results of plain data"


def packed(work: Callable[[Any], Any], job: Any) -> bytes:
    """A message for `unpacked`. Raises UserError if work or job cannot be sent."""
    if _importing:
        raise UserError(
            "this script starts workers when it is imported: put that part under if __name__ == '__main__':"
        )
    try:
        pickle.dumps(work)
    except Exception as error:
        raise UserError(f"{name_of(work)} cannot be sent to a worker: {reason(error)}; {BY_NAME}") from None
    try:
        body = pickle.dumps((work, job))
    except Exception as error:
        raise UserError(
            f"a job for {name_of(work)} cannot be sent to a worker: {reason(error)}; {PLAIN}"
        ) from None
    # The name is in the pickle of whatever the script defines; found elsewhere it costs an import, no more.
    return pickle.dumps((_main(work) if b"__main__" in body or MAIN.encode() in body else None, body))


def unpacked(message: bytes) -> tuple[Callable[[Any], Any], Any]:
    """Work and job of a message. Raises UserError if this process cannot load them."""
    main, body = pickle.loads(message)
    try:
        if main is not None:
            _import_main(*main)
        work, job = pickle.loads(body)
    except UserError:
        raise
    except Exception as error:
        raise UserError(f"a worker cannot load the work or the job: {reason(error)}; {BY_NAME}") from None
    return work, job


def answer(result: Any, wall_s: float) -> bytes:
    """What `answered` reads. Raises UserError if the result cannot be sent."""
    try:
        return pickle.dumps((True, result, wall_s))
    except Exception as error:
        kind = type(result).__name__
        raise UserError(f"the result, a {kind}, cannot be sent back: {reason(error)}; {PLAIN}") from None


def failure(error: BaseException, wall_s: float) -> bytes:
    """What `answered` reads: the exception itself if it survives pickling, or its type and text."""
    if isinstance(error, Exception):
        try:
            made = pickle.dumps((False, error, wall_s))
            pickle.loads(made)
            return made
        except Exception:
            pass
    return pickle.dumps((False, RuntimeError(reason(error)), wall_s))


def answered(message: bytes) -> tuple[bool, Any, float]:
    """Whether the work returned, its result or its exception, and how long it took [s]."""
    try:
        ok, value, wall_s = pickle.loads(message)
    except Exception as error:
        return False, UserError(f"the answer of a worker cannot be read here: {reason(error)}; {PLAIN}"), 0.0
    return ok, value, wall_s


def name_of(work: Any) -> str:
    """What to call a function in a message."""
    return str(getattr(work, "__qualname__", None) or type(work).__name__)


def reason(error: BaseException) -> str:
    """An exception in one line, even if its own text fails."""
    try:
        text = " ".join(str(error).split())
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _main(work: Any) -> tuple[str, str]:
    """How to import the script that was started: ("module", name) or ("path", path)."""
    main = sys.modules["__main__"]
    # What a worker sends back of the script's classes names them so.
    sys.modules.setdefault(MAIN, main)
    spec = getattr(main, "__spec__", None)
    if spec is not None and spec.name:
        return "module", spec.name
    path = getattr(main, "__file__", None)
    if path is None or not Path(path).is_file():
        raise UserError(
            f"{name_of(work)} cannot be sent to a worker: it is defined in an interactive session;"
            " put it into a file and import it from there"
        )
    return "path", str(Path(path).resolve())


def _import_main(kind: str, where: str) -> None:
    if MAIN in sys.modules:
        return
    module = ModuleType(MAIN)
    global _importing
    _importing = True
    try:
        if kind == "module":
            made = runpy.run_module(where, run_name=MAIN, alter_sys=True)
        else:
            made = runpy.run_path(where, run_name=MAIN)
    except UserError:
        raise
    except BaseException as error:
        raise UserError(f"a worker cannot import {where}: {reason(error)}") from None
    finally:
        _importing = False
    module.__dict__.update(made)
    sys.modules[MAIN] = sys.modules["__main__"] = module
