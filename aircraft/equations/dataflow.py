"""Reduces an autopilot's equations to blocks and the signals between them, for a block diagram.

Each output has a diagram of its own: the equations on which it depends while the autopilot is on. What is
computed of measurements alone counts as measured. Where equations are more than fit a page, they are joined
with those that read them, the ones first whose joining adds the fewest connections; states and commands stay
as long as they can.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from aircraft.equations.language import PERIOD, Channel, Equations, names_in

COMMANDS = ("v_cmd_mps", "omega_cmd_radps", "zeta_cmd_mps")
MOST_BLOCKS, MOST_COLUMNS = 12, 7
# What is no signal: the switch, the period, and what margins are measured with.
_NO_SIGNAL = {"on", "tracking", "dt", PERIOD}
# Costs, in connections: of joining a state, and of a block with more gains than one reads at a glance.
_STATE_COST, _CROWDED_COST, _CROWD = 2, 4, 9


@dataclass
class Block:
    """One signal and how it comes about.

    equations  how many were joined, itself included
    gains      gains and parameters that they read;  measured  what is used of the aircraft
    reads      other blocks' signals of this period;  late  those of the period before
    state      whether it reads its own last value, as integrators and filters do
    """

    name: str
    channel: str
    equations: int = 1
    gains: list[str] = field(default_factory=list)
    measured: list[str] = field(default_factory=list)
    reads: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    state: bool = False


def outputs(equations: Equations) -> list[str]:
    """The equations that drive the aircraft, in order."""
    flown = _flown(equations)
    return list(dict.fromkeys(e.name for c in flown for e in c.equations if e.output))


def blocks(equations: Equations, output: str, most: int = MOST_BLOCKS) -> list[Block]:
    """The blocks on which `output` depends, in order of evaluation, the output last; commands are none.

    Raises  ValueError if no equation of that name drives the aircraft
    """
    if output not in outputs(equations):
        raise ValueError(f"no output {output}; there are {', '.join(outputs(equations))}")
    order = _all(equations)
    wanted, queue = {output}, [output]
    while queue:
        block = order[queue.pop()]
        fresh = {*block.reads, *block.late} & order.keys() - wanted
        wanted |= fresh
        queue += sorted(fresh)
    kept = {name: block for name, block in order.items() if name in wanted}
    while len(kept) > most or (len(kept) > 2 and _depth(kept) > MOST_COLUMNS):
        cost = {name: _cost(name, kept) for name in kept if name != output}
        _join(min(cost, key=lambda name: (cost[name], list(kept).index(name))), kept)
    return list(kept.values())


def _depth(kept: dict[str, Block]) -> int:
    """Blocks on the longest way to the output, and the command that begins it."""
    depth: dict[str, int] = {}
    for block in kept.values():
        depth[block.name] = 1 + max((depth.get(name, 1) for name in block.reads), default=0)
    return max(depth.values())


def _flown(equations: Equations) -> list[Channel]:
    return [c for c in equations.channels if c.condition in (None, "on")]


def _all(equations: Equations) -> dict[str, Block]:
    """Every equation that is evaluated while the autopilot is on, as a block of its own."""
    found: dict[str, Block] = {}
    channels = _flown(equations)
    names = {e.name for c in channels for e in c.equations}
    gains = {*equations.parameters, *equations.needed()}
    for channel in channels:
        for e in channel.equations:
            block = found.setdefault(e.name, Block(e.name, channel.name))
            for name in sorted(names_in(e.formula), key=e.formula.index):
                if name in _NO_SIGNAL or name.endswith("_probe"):
                    continue
                if name in gains:
                    _add(block.gains, [name])
                elif name in equations.uses:
                    _add(block.measured, [name])
                elif name == e.name:
                    block.state = True
                elif name in COMMANDS or (name in found and name in names):
                    _add(block.reads, [name])
                elif name in names:
                    _add(block.late, [name])
    _measured(found)
    # What is read before it is evaluated keeps its last value: a state too.
    for name in {late for block in found.values() for late in block.late}:
        found[name].state = True
    return found


def _measured(found: dict[str, Block]) -> None:
    """Take out what depends on no command: whoever reads it reads a measurement. Outputs are kept."""
    led, more = set(COMMANDS), True
    while more:
        fresh = {b.name for b in found.values() if led & {*b.reads, *b.late}} - led
        more = bool(fresh)
        led |= fresh
    for name in [n for n in found if n not in led and not n.endswith("_norm")]:
        del found[name]
        for block in found.values():
            if name in (*block.reads, *block.late):
                _add(block.measured, [name])
            for names in (block.reads, block.late):
                if name in names:
                    names.remove(name)


def _cost(name: str, kept: dict[str, Block]) -> float:
    """What joining a block with those that read it adds in connections."""
    block = kept[name]
    readers = [b for b in kept.values() if name in b.reads or name in b.late]
    incoming = len(block.reads) + len(block.late)
    cost = float(incoming * len(readers) - incoming - len(readers))
    cost += _STATE_COST * block.state
    crowded = any(len({*b.gains, *block.gains}) > _CROWD for b in readers)
    return cost + _CROWDED_COST * crowded


def _join(name: str, kept: dict[str, Block]) -> None:
    gone = kept.pop(name)
    for block in kept.values():
        for mine, theirs in ((block.reads, gone.reads), (block.late, [*gone.reads, *gone.late])):
            if name not in mine:
                continue
            mine.remove(name)
            known = {*block.reads, *block.late, block.name}
            _add(mine, [n for n in theirs if n not in known])
            if mine is block.reads:
                _add(block.late, [n for n in gone.late if n not in known])
            block.state |= block.name in (*gone.reads, *gone.late)
            _add(block.gains, gone.gains)
            _add(block.measured, gone.measured)
            block.equations += gone.equations


def _add(to: list[str], names: Iterable[str]) -> None:
    to.extend(n for n in names if n not in to)
