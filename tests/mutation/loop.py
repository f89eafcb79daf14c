"""A pytest plugin that, instead of running the collected tests once, runs them against every mutant.

Each mutant gets a fork of this process, in which everything is imported and collected already, and the tests
that reach its lines: first those that killed others of the same function, then the quickest, those of the
module itself being preferred.
"""

from __future__ import annotations

import gc
import hashlib
import importlib
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from mutation import child
from mutation.mutants import Mutant, unchanged
from mutation.record import Outcome, Record, version, weight

# s; a test may take this long and this many times its own time before it counts as hanging.
PATIENCE, TIMES = 4.0, 10.0
TRACE_LIMIT = 60.0

CACHE = type(lru_cache(lambda: None))


class Loop:
    """Runs the mutants given.

    seconds  budget of tests' own time for each mutant, beyond which no more are run
    """

    def __init__(
        self, root: Path, files: list[str], mutants: list[Mutant], record: Record, seconds: float
    ) -> None:
        self.root, self.files, self.mutants, self.record, self.seconds = root, files, mutants, record, seconds
        self.kills: dict[str, Counter[str]] = defaultdict(Counter)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        if session.testsfailed:
            raise session.Interrupted(f"{session.testsfailed} errors during collection")
        gc.collect()
        functions = _living(self.root, self.files)
        caches = [thing for thing in gc.get_objects() if isinstance(thing, CACHE)]
        gc.freeze()  # what is here is shared by all forks
        items = {item.nodeid: item for item in session.items}
        reached = self._reached(items, caches)
        for control in self._controls(reached):
            tests = self.chosen(control, reached)
            result, by = self._tried(control, [items[t] for t in tests], reached, functions, caches)
            if result != "survived":
                raise session.Failed(f"{control.file} {control.place}, unchanged: {result} {by}")
        for number, mutant in enumerate(self.mutants):
            tests = self.chosen(mutant, reached)
            of = version({t: reached[t] for t in tests})
            if self.record.settled(mutant, of):
                continue
            result, by = self._tried(mutant, [items[t] for t in tests], reached, functions, caches)
            self.record.add(mutant, Outcome(result, by, len(tests), of))
            if by:
                self.kills[mutant.file + mutant.place][by] += 1
            if number % 100 == 99:
                print(f"{number + 1} of {len(self.mutants)}", file=sys.stderr, flush=True)
        return True

    def _controls(self, reached: dict[str, Any]) -> list[Mutant]:
        """Of every file one mutant's function as it is: what fails with it says nothing about mutants."""
        first = {m.file: m for m in reversed(self.mutants) if self.chosen(m, reached)}
        return [unchanged(self.root, file, m.place) for file, m in first.items()]

    def chosen(self, mutant: Mutant, reached: dict[str, Any]) -> list[str]:
        """The tests that reach the mutant's lines, in the order to try them."""
        first, last = mutant.lines
        lines = set(range(first, last + 1))
        kills = self.kills[mutant.file + mutant.place]
        tests = [t for t, seen in reached.items() if seen["passed"] and lines & seen["lines"][mutant.file]]
        tests.sort(key=lambda t: (-kills[t], reached[t]["seconds"] * weight(mutant.file, t)))
        spent, within = 0.0, []
        for t in tests:
            spent += reached[t]["seconds"]
            if within and spent > self.seconds:
                break
            within.append(t)
        return within

    def _reached(self, items: dict[str, pytest.Item], caches: list[Any]) -> dict[str, Any]:
        """Of every test: whether it passes, its time, and the lines it reaches in each file."""
        sources = {f: hashlib.sha256((self.root / f).read_bytes()).hexdigest()[:16] for f in self.files}
        known = self.record.reached(sources)
        for n, (nodeid, item) in enumerate(items.items()):
            test = hashlib.sha256(Path(item.path).read_bytes()).hexdigest()[:16]
            old = known.get(nodeid)
            if old and old["test"] == test:
                continue
            paths = {str(self.root / f): f for f in self.files}

            def work(allow: Callable[[float], None], item: pytest.Item = item, paths: Any = paths) -> Any:
                # What importing the tests has cached already, a test would not be seen to reach.
                for cache in caches:
                    cache.cache_clear()
                return _traced(item, paths)

            seen = child.run(work, TRACE_LIMIT)
            if not isinstance(seen, dict):
                seen = {"passed": False, "seconds": TRACE_LIMIT, "lines": {}}
            touched = {f: sources[f] for f in seen["lines"]}
            known[nodeid] = seen | {"test": test, "sources": touched}
            if n % 100 == 99:
                print(f"{n + 1} of {len(items)} tests traced", file=sys.stderr, flush=True)
        self.record.keep_reached(known, set(items))
        none: set[int] = set()
        return {
            t: seen | {"lines": defaultdict(lambda: none, {f: set(k) for f, k in seen["lines"].items()})}
            for t, seen in known.items()
            if t in items
        }

    def _tried(
        self,
        mutant: Mutant,
        tests: list[pytest.Item],
        reached: dict[str, Any],
        functions: dict[tuple[str, str], list[FunctionType]],
        caches: list[Any],
    ) -> tuple[str, str]:
        if not tests:
            return "survived", ""

        def work(allow: Callable[[float], None]) -> Any:
            try:
                _put(mutant, functions[mutant.file, mutant.place], caches)
            except (LookupError, ValueError) as error:
                return {"not put in": repr(error)}
            for k, item in enumerate(tests):
                allow(PATIENCE + TIMES * reached[item.nodeid]["seconds"])
                after = tests[k + 1] if k + 1 < len(tests) else None
                if any(r.failed for r in runtestprotocol(item, log=False, nextitem=after)):
                    return item.nodeid
            return None

        result = child.run(work, PATIENCE)
        if isinstance(result, dict):
            raise RuntimeError(f"{mutant.file} {mutant.place}: {result}")
        if result in ("timeout", "crash"):
            return result, ""
        return ("killed", result) if result else ("survived", "")


def _traced(item: pytest.Item, paths: dict[str, str]) -> dict[str, Any]:
    lines: dict[str, set[int]] = defaultdict(set)

    def enter(frame: FrameType, event: str, argument: object) -> Any:
        file = paths.get(frame.f_code.co_filename)
        if file is None:
            return None
        seen = lines[file]
        seen.add(frame.f_code.co_firstlineno)

        def line(frame: FrameType, event: str, argument: object) -> Any:
            seen.add(frame.f_lineno)
            return line

        return line

    sys.settrace(enter)
    reports = runtestprotocol(item, log=False, nextitem=None)
    sys.settrace(None)
    passed = all(r.passed for r in reports)
    seconds = sum(r.duration for r in reports)
    return {"passed": passed, "seconds": seconds, "lines": {f: sorted(k) for f, k in lines.items()}}


def _living(root: Path, files: list[str]) -> dict[tuple[str, str], list[FunctionType]]:
    """Every function object of the files, by file and qualified name; all of them are imported first."""
    for file in files:
        importlib.import_module(file.removesuffix(".py").replace("/", "."))
    paths = {str(root / f): f for f in files}
    found: dict[tuple[str, str], list[FunctionType]] = defaultdict(list)
    for thing in gc.get_objects():
        if isinstance(thing, FunctionType) and thing.__code__.co_filename in paths:
            found[paths[thing.__code__.co_filename], thing.__code__.co_qualname].append(thing)
    return found


def _put(mutant: Mutant, functions: list[FunctionType], caches: list[Any]) -> None:
    """The mutant's code into the living function, and an end to what was remembered of the old one."""
    code: CodeType = mutant.code()
    if not functions:
        raise LookupError(f"no living function {mutant.file} {mutant.place}")
    for function in functions:
        function.__code__ = code
    for cache in caches:
        cache.cache_clear()
