"""Finds parts of installed packages by their entry points, and their checksums."""

from __future__ import annotations

import hashlib
import importlib.util
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from testbed.components.own_code.spelling import ROLES
from testbed.errors import UserError, nearest, short
from testbed.scenario.installed import GROUPS, names


@dataclass(frozen=True)
class Installed:
    """An installed part.

    entry    its name among the entry points
    value    module:attribute
    package  name and version of the distribution
    sha256   of the sources of its package, as they were when it was found
    """

    role: str
    entry: str
    value: str
    package: str
    sha256: str

    @property
    def module_name(self) -> str:
        return self.value.partition(":")[0]

    @property
    def attribute(self) -> str:
        """Name of the class or function."""
        return self.value.partition(":")[2]

    @property
    def file(self) -> Path | None:
        """The source file of its module; None where it has none."""
        return _origin(self.module_name)

    @lru_cache(maxsize=64)  # noqa: B019 - a few parts, which are data
    def loaded(self) -> Any:
        """The class or function, imported. UserError if that fails, or its sources are others than found."""
        here = sources_sha256(self.module_name)
        if here != self.sha256:
            raise UserError(
                f"{self.role} {self.entry}: package {self.package} has other sources here (SHA-256"
                f" {here[:12]}) than where the work began ({self.sha256[:12]}); install the same"
            )
        point = EntryPoint(self.entry, self.value, GROUPS[self.role])
        try:
            return point.load()
        except Exception as error:
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise UserError(f"{self.role} {self.entry}: importing {self.value} raised {said}") from None


def find(name: str, role: str | None = None) -> Installed:
    """The installed part of that name.

    Raises UserError, listing what is installed, if there is none, or more than one
    """
    roles = ROLES if role is None else (role,)
    found = [(r, point) for r in roles for point in entry_points(group=GROUPS[r]) if point.name == name]
    if not found:
        known = sorted({n for r in roles for n in names(r)})
        what = f"{role} " if role else "part "
        listed = nearest(name, known) if known else "no package here offers any; FILE.py:NAME names a file's"
        raise UserError(f"no {what}{short(name)!r} is installed; {listed}")
    if len({r for r, _ in found}) > 1:
        which = " or ".join(r for r, _ in found)
        raise UserError(f"--parts {name}: installed as {which}; name the role: {found[0][0]}={name}")
    if len({point.value for _, point in found}) > 1:
        packages = " and ".join(point.dist.name if point.dist else "?" for _, point in found)
        raise UserError(f"{found[0][0]} {name!r} is in two packages, {packages}; remove one of them")
    its_role, point = found[0]
    package = f"{point.dist.name} {point.dist.version}" if point.dist else point.value.partition(".")[0]
    return Installed(its_role, name, point.value, package, sources_sha256(point.value.partition(":")[0]))


def sources_sha256(module: str) -> str:
    """Checksum of all Python sources of a module's top package, or of the module where it is in none.

    Raises UserError where there is no source
    """
    top = module.partition(".")[0]
    origin = _origin(top)
    if origin is None:
        raise UserError(f"package {top} has no Python source that could be told apart by checksum")
    digest = hashlib.sha256()
    files = sorted(origin.parent.rglob("*.py")) if origin.name == "__init__.py" else [origin]
    for file in files:
        digest.update(file.relative_to(origin.parent).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _origin(module: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError, AttributeError):
        return None
    file = Path(spec.origin) if spec and spec.origin else None
    return file if file is not None and file.suffix == ".py" and file.is_file() else None
