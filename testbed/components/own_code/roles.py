"""Tells the role of a user's class or function, and calls it with what its parameters name.

The role is the first of these that says one:
1. `ROLE=` before it, or an attribute `role` of the class or function: "plant", "filter", "guidance" or
   "environment";
2. of a class its methods: `reset`, `step`, `state`, `achieved`, `telemetry` and `faults` make a plant, `wind`
   and `observe` an environment, `__call__` with three parameters a filter, with two guidance;
3. of a function its parameters: `(view, nominal, limits)` is a filter itself and `(t, view)` or `(t, state)`
   guidance itself; `(scenario, barrier, goal)`, `(scenario, goal, barrier)`, `(scenario, wind)` and
   `(scenario, generators)` make a filter, guidance, a plant and an environment;
4. of a function its return annotation, where that is a class that rule 2 knows.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Mapping
from math import inf
from typing import Any, get_type_hints

from testbed.components.own_code.spelling import ROLES
from testbed.errors import UserError, nearest

# What the testbed hands to a maker, by position as `Parts` calls it; a parameter of that name is given it.
GIVEN = {
    "plant": ("scenario", "wind"),
    "filter": ("scenario", "barrier", "goal"),
    "guidance": ("scenario", "goal", "barrier"),
    "environment": ("scenario", "generators"),
}
METHODS = {
    "plant": ("reset", "step", "state", "achieved", "telemetry", "faults"),
    "filter": ("__call__",),
    "guidance": ("__call__",),
    "environment": ("wind", "observe"),
}
# Parameters of a function that is the part itself and not its maker.
ITSELF: dict[str, list[tuple[str, ...]]] = {
    "filter": [("view", "nominal", "limits")],
    "guidance": [("t", "view"), ("t", "state")],
}
HOW = "name the role, for example --parts filter={where}"


def role_of(target: Any, where: str, said: str | None = None) -> str:
    """The role of a class or function.

    said    the role written before it
    Raises  UserError if it is neither, has no role, more than one, or lacks a method of the role said
    """
    if not inspect.isclass(target) and not callable(target):
        raise UserError(f"--parts {where}: it is {_a(target)}, not a class or function that makes a part")
    if not inspect.isclass(target) and not _is_function(target):
        kind = type(target).__name__
        raise UserError(
            f"--parts {where}: it is an object of class {kind}, which runs would share; name the class"
        )
    said = said or _attribute(target)
    if said is not None:
        _check_methods(target, where, said)
        return said
    found = _of_class(target) if inspect.isclass(target) else _of_function(target)
    if len(found) == 1:
        return found[0]
    how = HOW.format(where=where)
    if found:
        raise UserError(f"--parts {where}: it may be {' or '.join(found)}; {how}")
    if inspect.isclass(target):
        raise UserError(
            f"--parts {where}: no part of any role: a filter has __call__(view, nominal, limits), guidance"
            f" __call__(t, view), a plant {', '.join(METHODS['plant'])}, an environment wind and observe"
        )
    raise UserError(f"--parts {where}: what this function makes is not known; {how}")


def is_itself(target: Any, role: str) -> bool:
    """Whether a function is the part itself, to be called at every step, and not its maker."""
    names = tuple(p.name for p in _parameters(target))
    return not inspect.isclass(target) and any(names[: len(own)] == own for own in ITSELF.get(role, ()))


def check_arguments(target: Any, where: str, role: str, arguments: Mapping[str, Any]) -> None:
    """UserError for an argument that a maker does not take, or one that it needs and nobody gives."""
    own = {name for names in ITSELF.get(role, []) for name in names} if is_itself(target, role) else set()
    parameters = [p for p in _parameters(target) if p.name not in own]
    anything = any(p.kind is p.VAR_KEYWORD for p in parameters) or not _known(target)
    takes = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    for name in arguments:
        if name not in takes and not anything:
            offered = [n for n in takes if n not in GIVEN[role]]
            hint = nearest(name, offered) if offered else "it takes none"
            raise UserError(f"--parts {where}: it takes no argument {name!r}; {hint}")
    given = {*arguments, *GIVEN[role], *own}
    missing = [p.name for p in parameters if p.default is p.empty and _one(p) and p.name not in given]
    if missing:
        example = ", ".join(f"{name}=..." for name in missing)
        raise UserError(
            f"--parts {where}: it needs {' and '.join(missing)}: give '{where}({example})'; {_handed(role)}"
        )


def make(target: Any, role: str, given: tuple[Any, ...], arguments: Mapping[str, Any]) -> Any:
    """The part: the maker called with `given`, in the order of GIVEN, as far as its parameters name them.

    The user's own arguments come before what the testbed gives under that name.
    """
    own = copy.deepcopy(dict(arguments))
    if is_itself(target, role):
        return _Bound(target, own) if own else target
    offered = dict(zip(GIVEN[role], given, strict=True)) | own
    parameters = _parameters(target)
    values = {p.name: offered[p.name] for p in parameters if _one(p) and p.name in offered}
    extra = {name: value for name, value in own.items() if name not in values}
    if not _known(target):
        return target(**own)
    bound = inspect.signature(target).bind_partial()
    bound.arguments.update(values)
    return target(*bound.args, **bound.kwargs, **extra)


class _Bound:
    """A function that is a part itself, with the user's arguments."""

    def __init__(self, function: Callable[..., Any], arguments: dict[str, Any]) -> None:
        self._function, self._arguments = function, arguments
        self.__signature__ = inspect.signature(function)

    def __call__(self, *given: Any) -> Any:
        return self._function(*given, **self._arguments)


def _handed(role: str) -> str:
    return f"the testbed gives a {role} what it names of {', '.join(GIVEN[role])}"


def _attribute(target: Any) -> str | None:
    role = inspect.getattr_static(target, "role", None)
    return role if isinstance(role, str) and role in ROLES else None


def _of_class(target: Any) -> list[str]:
    found = [role for role in ("plant", "environment") if not _lacks(target, role)]
    if not _lacks(target, "filter"):
        least, most = _positional(target.__call__)
        # The first is self.
        found += [role for role, count in (("filter", 4), ("guidance", 3)) if least <= count <= most]
    return found


def _of_function(target: Any) -> list[str]:
    for role in ITSELF:
        if is_itself(target, role):
            return [role]
    names = tuple(p.name for p in _parameters(target))
    made = [role for role, given in GIVEN.items() if names[: len(given)] == given]
    if made:
        return made
    try:
        returned = get_type_hints(target).get("return")
    except Exception:  # names that are not there, or not yet
        return []
    return _of_class(returned) if inspect.isclass(returned) else []


def _positional(call: Any) -> tuple[int, float]:
    """The least and the largest number of positional arguments that a function takes."""
    parameters = _parameters(call)
    own = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    several = any(p.kind is p.VAR_POSITIONAL for p in parameters)
    return sum(p.default is p.empty for p in own), inf if several else len(own)


def _check_methods(target: Any, where: str, role: str) -> None:
    if not inspect.isclass(target) or hasattr(target, "__getattr__"):
        return
    if lacks := _lacks(target, role):
        raise UserError(f"--parts {where}: as {role} it lacks {', '.join(f'{n}()' for n in lacks)}")


def _lacks(target: Any, role: str) -> list[str]:
    """Methods of a role that instances of a class do not have."""

    # Not those of its metaclass: every class can be called.
    own = {name for base in target.__mro__ for name, value in vars(base).items() if value is not None}
    return [name for name in METHODS[role] if name not in own]


def _is_function(target: Any) -> bool:
    while hasattr(target, "func") and hasattr(target, "keywords"):  # functools.partial
        target = target.func
    return inspect.isroutine(target) or inspect.isclass(target)


def _parameters(target: Any) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(target).parameters.values())
    except (TypeError, ValueError):
        return []


def _known(target: Any) -> bool:
    try:
        inspect.signature(target)
    except (TypeError, ValueError):
        return False
    return True


def _one(parameter: inspect.Parameter) -> bool:
    return parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)


def _a(value: Any) -> str:
    name = type(value).__name__
    return f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"
