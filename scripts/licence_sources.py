"""Everything that cadpose is made of or comes to use: packages, networks, scripts of the page, CAD models."""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from licence_names import ALSO_INSIDE, UNKNOWN, licence_of, normal, spdx
from packaging.requirements import Requirement

from cadpose.detection.mmdet.packages import WHEELS
from cadpose.library.catalogue import Library
from cadpose.similarity.xfeat import WEIGHTS as XFEAT
from cadpose.training.posecontrast.loading import CHECKPOINTS
from cadpose.weights import REGISTRY, UNPUBLISHED, Unpublished, Weights

ROOT = Path(__file__).resolve().parent.parent
#: Extras that developers install; a user's program never imports what they bring.
TOOLS = ("test", "docs", "browser", "release")
#: What is to be known of weights beside their licence.
OF_WEIGHTS = {
    "moco": "the repository's when they were published; the MIT licence of today is told of its code",
}


@dataclass(frozen=True)
class Component:
    """One thing with a licence.

    Attributes:
        name: Its name where it is published.
        version: Empty where there is none.
        licence: SPDX expression, or NOASSERTION.
        source: Where it comes from, as an address or a purl.
        note: What else there is to say.
        needs: Names of components that it brings.
    """

    name: str
    version: str
    licence: str
    source: str = ""
    note: str = ""
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Inventory:
    """All of it.

    Attributes:
        packages: Python packages by normal name.
        extras: Direct requirements by extra, ``""`` for the core.
        missing: Direct or brought packages that are not installed here.
        apart: Packages in virtualenvs or folders of their own.
        networks: Weights.
        page: What is bundled in the review page.
        models: CAD models by source.
    """

    packages: dict[str, Component]
    extras: dict[str, tuple[str, ...]]
    missing: tuple[str, ...]
    apart: tuple[Component, ...]
    networks: tuple[Component, ...]
    page: tuple[Component, ...]
    models: tuple[Component, ...]

    def brought(self, names: Iterable[str]) -> set[str]:
        """Those packages and all that they bring."""
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name not in found and name in self.packages:
                found.add(name)
                waiting += self.packages[name].needs
        return found


def requirements() -> dict[str, list[Requirement]]:
    """Direct requirements of pyproject.toml by extra, ``""`` for the core."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {"": project["dependencies"], **project["optional-dependencies"]}
    return {extra: [Requirement(text) for text in texts] for extra, texts in listed.items()}


@dataclass
class _Walk:
    """Follows requirements through what is installed."""

    packages: dict[str, Component] = field(default_factory=dict)
    missing: set[str] = field(default_factory=set)
    seen: set[tuple[str, frozenset[str]]] = field(default_factory=set)

    def follow(self, requirement: Requirement, extras: frozenset[str] = frozenset()) -> str | None:
        """The normal name of a requirement that holds here, with all below it taken in."""
        wanted = requirement.marker is None or any(
            requirement.marker.evaluate({"extra": extra}) for extra in (extras or {""})
        )
        if not wanted:
            return None
        name = normal(requirement.name)
        key = (name, frozenset(requirement.extras))
        if key in self.seen:
            return name
        self.seen.add(key)
        try:
            found = distribution(requirement.name)
        except PackageNotFoundError:
            self.missing.add(name)
            return name
        below = {self.follow(Requirement(text), key[1]) for text in found.requires or ()}
        earlier = self.packages[name].needs if name in self.packages else ()
        self.packages[name] = _package(found, tuple(sorted({n for n in below if n} | set(earlier))))
        return name


def _package(found: Distribution, needs: tuple[str, ...]) -> Component:
    name = normal(found.metadata["Name"])
    licence, _ = licence_of(found)
    note = f"with {ALSO_INSIDE[name]}" if name in ALSO_INSIDE else ""
    # A build's own mark (2.13.0+cpu) is none of the version that a package index has.
    version = found.version.partition("+")[0]
    return Component(found.metadata["Name"], version, licence, f"pkg:pypi/{name}@{version}", note, needs)


def _network(weights: Weights | Unpublished) -> Component:
    licence = _expression(weights.licence)
    if isinstance(weights, Unpublished):
        note = "; ".join(filter(None, ("put in place by a person", OF_WEIGHTS.get(weights.name))))
        return Component(weights.name, "", licence, weights.url, note)
    if not weights.package:
        return Component(weights.name, "", licence, weights.url, "fetched when asked for")
    if weights.package == "cadpose":
        return Component(weights.name, "", licence, f"src/cadpose/{weights.file}", "in the package")
    return Component(weights.name, "", licence, weights.requirement, f"in {weights.requirement}")


def _expression(licence: str) -> str:
    return spdx(licence.replace(" or ", " OR ")) or UNKNOWN


def _page() -> tuple[Component, ...]:
    """What npm's lock file says of the packages that are no tools of the build."""
    lock = json.loads((ROOT / "web" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    told = (ROOT / "src/cadpose/review/static/licenses.md").read_text(encoding="utf-8")
    found = []
    for path, entry in sorted(lock.items()):
        name = path.rpartition("node_modules/")[2]
        # A licence in the bundle's own list is what was bundled.
        if name and not entry.get("dev") and f"## {name} - {entry['version']} " in told:
            purl = f"pkg:npm/{name.replace('@', '%40')}@{entry['version']}"
            found.append(Component(name, entry["version"], spdx(entry.get("license", "")) or UNKNOWN, purl))
    return tuple(found)


def _models(library: Library | None) -> tuple[Component, ...]:
    """Sources of CAD models; those of Sweet Home 3D are counted where they are imported."""
    counts = Counter(
        model.licence
        for model in (library.models() if library else ())
        if model.source.startswith("sweethome3d:")
    )
    told = ", ".join(f"{licence} {count}" for licence, count in counts.most_common())
    return (
        Component(
            "sweethome3d-furniture",
            "",
            "CC-BY-3.0 AND CC-BY-3.0-US AND CC0-1.0",
            "Debian's package; not shipped",
            f"one of the three by model: {told}" if told else "one of the three by model",
        ),
        Component("parametric", "", "CC0-1.0", "made by cadpose", "what `library add parametric` makes"),
        Component("ShapeNetCore", "", "LicenseRef-ShapeNet", "", "whoever asks for it accepts the terms"),
    )


def _apart() -> tuple[Component, ...]:
    """What two verbs set up in virtualenvs and folders of their own."""
    verb = "`cadpose blender setup`: a process of its own"
    found = [Component("bpy", "", "GPL-3.0-or-later", "pkg:pypi/bpy", verb)]
    for requirement in WHEELS:
        name, _, version = requirement.partition("==")
        purl = f"pkg:pypi/{name}@{version}"
        found.append(Component(name, version, "Apache-2.0", purl, "`cadpose detectors setup`"))
    return tuple(found)


def collect(library: Library | None) -> Inventory:
    """The inventory of this checkout and of the packages that are installed here."""
    walk = _Walk()
    extras = {}
    for extra, listed in requirements().items():
        names = [walk.follow(requirement, frozenset({extra})) for requirement in listed]
        extras[extra] = tuple(sorted(name for name in names if name))
    networks = [_network(weights) for weights in (*REGISTRY.values(), XFEAT)]
    networks += [_network(weights) for weights in (*UNPUBLISHED.values(), *CHECKPOINTS.values())]
    return Inventory(
        walk.packages,
        extras,
        tuple(sorted(walk.missing)),
        _apart(),
        tuple(networks),
        _page(),
        _models(library),
    )
