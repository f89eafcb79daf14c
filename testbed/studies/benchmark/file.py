"""Defines and reads the benchmark file: filters, plants and sets of encounters by name."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, model_validator

from aircraft.textfile import line_of, parse_toml, read_text
from testbed.encounters.generating import KINDS
from testbed.encounters.importing import FORMATS
from testbed.errors import UserError, nearest, short
from testbed.scenario.explain import explain
from testbed.scenario.fields import Name, Section

MOST_RUNS = 1_000_000
_FOLDER = resources.files("testbed.studies.benchmark") / "files"


def _kinds(names: list[str]) -> list[str]:
    for name in names:
        if name not in KINDS:
            raise ValueError(f"there is no kind {short(name)!r}; {nearest(name, KINDS)}")
    return names


class EncounterSet(Section):
    """Encounters imported from one file, perturbed from a seed, or generated from it."""

    file: str = Field(default="", description="to import, from the benchmark file's folder")
    format: Literal["daa", "scn", "table", "csv", ""] = Field(default="", description="of that file")
    generate: Annotated[list[str], AfterValidator(_kinds)] = Field(
        default=[], description="kinds as `testbed encounters generate` has them, one after the other"
    )
    n: Annotated[int, Field(ge=1, le=100_000)] = Field(default=100, description="encounters")
    others: Literal["track", "keep-course", "filter"] = Field(
        default="filter", description="what the other vehicles fly"
    )
    own: Literal["track", "goal"] = Field(default="track", description="what the own vehicle wants")
    vehicles: Annotated[int, Field(ge=2, le=200)] = Field(default=2, description="generated: how many")
    density: Annotated[float, Field(gt=0)] = Field(
        default=10.0, description="generated: vehicles per square kilometre, of random"
    )
    miss_m: Annotated[float, Field(ge=0, le=500)] = Field(
        default=10.0, description="largest change of place, or generated miss distance, to the side"
    )
    height_m: Annotated[float, Field(ge=0, le=500)] = Field(
        default=2.5, description="imported: largest change of height"
    )
    course_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        default=10.0, description="imported: largest change of course"
    )
    reach_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=5.0, description="how long after the closest approach paths go on; the end is the goal"
    )
    slack_s: Annotated[float, Field(gt=0, le=3600)] = Field(
        default=7.0, description="how much later than undisturbed a run ends"
    )

    @model_validator(mode="after")
    def one_source(self) -> EncounterSet:
        if bool(self.file) == bool(self.generate):
            raise ValueError("say file and format, or generate")
        if self.file and not self.format:
            raise ValueError(f"format: say one of {', '.join(FORMATS)}")
        return self


class Benchmark(Section):
    """Every filter flies every set on every plant, each from the same encounters."""

    schema_version: Literal[1] = 1
    name: Name
    description: Annotated[str, Field(max_length=2000)] = ""
    seed: Annotated[int, Field(ge=0, le=2**62)] = Field(default=1, description="of all sets")
    reference: str = Field(default="", description="the filter that others are compared with; the first")
    without: str = Field(default="", description="the filter that does nothing, for risk ratios")
    set: dict[str, Any] = Field(default={}, description="fields of every run")
    filters: dict[str, dict[str, Any]] = Field(description="name -> fields; filter.kind at least")
    candidates: dict[str, list[dict[str, Any]]] = Field(
        default={}, description="filter -> settings that --search tries in place of those of [filters]"
    )
    share: dict[str, Annotated[float, Field(gt=0, le=1)]] = Field(
        default={}, description="filter -> share of each set's encounters that it flies, where a step is dear"
    )
    plants: dict[str, dict[str, Any]] = Field(description="name -> fields; plant at least")
    sets: dict[str, EncounterSet]

    @model_validator(mode="after")
    def consistent(self) -> Benchmark:
        for name, of in (("filters", self.filters), ("plants", self.plants), ("sets", self.sets)):
            if not of:
                raise ValueError(f"{name}: give at least one")
        named = [("reference", self.reference), ("without", self.without)]
        named += [("candidates", name) for name in self.candidates]
        named += [("share", name) for name in self.share]
        for field, said in named:
            if said and said not in self.filters:
                raise ValueError(f"{field}: no filter {short(said)!r}; {nearest(said, self.filters)}")
        runs = len(self.filters) * len(self.plants) * sum(s.n for s in self.sets.values())
        if runs > MOST_RUNS:
            raise ValueError(f"sets: {runs} runs are more than {MOST_RUNS}; give a smaller n")
        return self

    def encounters(self, filter_: str, set_: str) -> int:
        """How many encounters of a set a filter flies: the first ones."""
        return max(1, round(self.share.get(filter_, 1.0) * self.sets[set_].n))

    @property
    def first(self) -> str:
        """The filter that others are compared with."""
        return self.reference or next(iter(self.filters))


def builtin() -> list[str]:
    """Names of benchmarks that come with the package."""
    return sorted(f.name.removesuffix(".toml") for f in _FOLDER.iterdir() if f.name.endswith(".toml"))


def load(source: str) -> tuple[Benchmark, Path]:
    """A benchmark by name or file, and the folder its paths start from.

    Raises UserError in one line, with the file and the field's path.
    """
    path = Path(source)
    if not path.is_file() and source in builtin():
        path = Path(str(_FOLDER)) / f"{source}.toml"
    try:
        text = read_text(path)
        data = parse_toml(text)
    except FileNotFoundError:
        known = nearest(source, builtin())
        raise UserError(f"there is no benchmark {short(source)!r}, nor such a file; {known}") from None
    except OSError as error:
        raise UserError(f"benchmark file {short(source)}: {error.strerror}") from None
    except ValueError as error:
        raise UserError(str(error), file=source) from None
    try:
        return parse(data, source), path.parent
    except UserError as error:
        raise error.located(lambda field: line_of(text, field.split("."))) from None


def parse(data: dict[str, Any], where: str) -> Benchmark:
    """A benchmark of plain data. Raises UserError."""
    try:
        return Benchmark.model_validate(data)
    except ValidationError as error:
        raise UserError(*explain(error, Benchmark), file=where) from None


def shortened(b: Benchmark, most: int) -> Benchmark:
    """The benchmark with at most `most` encounters in each set."""
    sets = {name: s.model_copy(update={"n": min(s.n, most)}) for name, s in b.sets.items()}
    return b.model_copy(update={"sets": sets})
