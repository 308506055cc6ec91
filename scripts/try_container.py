"""Carry out the Containerfile without a container engine, and run what comes of it.

    python scripts/try_container.py --photo PHOTO [--base FOLDER] [--work FOLDER]

A base of Debian is made by debootstrap (or taken from --base, a folder that it made), each instruction is
carried out in a chroot of its copy, and the entry point is run on the photo as the container's user. It needs
root, Linux, debootstrap and a network. What it cannot show: that the base image's tag exists, what an engine
does with volumes and ports, and the base image's own trimming; the packages are those of the same release.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: Debian release of the base image, by its major version.
RELEASES = {"12": "bookworm", "13": "trixie"}
#: Of the host's variables, what pip needs: an index, a proxy.
PASSED = re.compile(r"(PIP_(INDEX_URL|DEFAULT_TIMEOUT)|https?_proxy|no_proxy)$", re.IGNORECASE)
#: Where the host's certificates are copied, beside Debian's own, which a package may write anew.
CERTIFICATES = "/run/host-certificates.crt"
FORMS = {"FROM", "RUN", "ENV", "USER", "WORKDIR", "VOLUME", "EXPOSE", "ENTRYPOINT", "CMD"}


@dataclass
class Image:
    """What instructions have made so far."""

    root: Path
    environment: dict[str, str] = field(default_factory=lambda: {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"})
    user: str = "root"
    folder: str = "/"
    entry: list[str] = field(default_factory=list)
    volumes: list[str] = field(default_factory=list)


def instructions(text: str) -> list[tuple[str, str]]:
    """Instruction and what follows, with continued lines joined and comments left out."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ").splitlines()
    found = [(line.split(maxsplit=1)[0].upper(), line.split(maxsplit=1)[1].strip()) for line in joined]
    strange = {name for name, _ in found} - FORMS
    if strange:
        sys.exit(f"the script knows no {', '.join(sorted(strange))}: teach it, or it would try another image")
    return found


def inside(
    image: Image, command: Sequence[str], *, network: bool, binds: Sequence[tuple[Path, str]] = ()
) -> subprocess.CompletedProcess[str]:
    """Run a command in the image as its user, in mounts and processes of its own.

    Without a network it is as ``--network none --read-only --tmpfs /tmp``: nothing but volumes can be
    written.
    """
    passed = {k: v for k, v in os.environ.items() if network and PASSED.match(k)}
    if network and (image.root / CERTIFICATES.lstrip("/")).is_file():
        passed["PIP_CERT"] = CERTIFICATES
    user = image.user
    home = "/root" if user == "root" else f"/home/{user}"
    words = [f"{k}={v}" for k, v in {"HOME": home, **passed, **image.environment}.items()]
    root = shlex.quote(str(image.root))
    sealed = [
        f"mount --bind {root} {root}",
        *(f"mount --bind {root}{volume} {root}{volume}" for volume in image.volumes),
        f"mount -o remount,bind,ro {root}",
        f"mount -t tmpfs -o mode=1777 tmp {root}/tmp",
    ]
    mounts = [
        *([] if network else sealed),
        f"mount -t proc proc {root}/proc",
        *(f"mount --bind /dev/{name} {root}/dev/{name}" for name in ("null", "zero", "random", "urandom")),
        f"mount -t tmpfs -o mode=1777 shm {root}/dev/shm",
    ]
    for source, target in binds:
        (image.root / target.lstrip("/")).mkdir(parents=True, exist_ok=True)
        mounts.append(f"mount --bind -o ro {shlex.quote(str(source))} {root}{target}")
    line = f"cd {shlex.quote(image.folder)} && exec {shlex.join(command)}"
    groups = "" if user == "root" else f"--userspec={user}:{user} "
    mounts.append(
        f"exec chroot {groups}{root} /usr/bin/env -i {shlex.join(words)} /bin/sh -c {shlex.quote(line)}"
    )
    return subprocess.run(
        [
            "unshare",
            "--mount",
            "--pid",
            "--fork",
            *([] if network else ["--net"]),
            "/bin/sh",
            "-ec",
            "\n".join(mounts),
        ],
        capture_output=True,
        text=True,
        check=False,
    )


def insist(
    image: Image, command: Sequence[str], *, network: bool, binds: Sequence[tuple[Path, str]] = ()
) -> str:
    """Run a command that has to succeed; gives what it printed."""
    done = inside(image, command, network=network, binds=binds)
    if done.returncode:
        sys.exit(
            f"{shlex.join(command)}\nended with {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        )
    return done.stdout


def base(image: str, folder: Path) -> None:
    """A minimal Debian of the image's release."""
    match = re.fullmatch(r"debian:(\d+)\.\d+-slim", image)
    if match is None or match[1] not in RELEASES:
        sys.exit(f"{image} is no base that this script can make: debian:N.M-slim")
    command = ["debootstrap", "--variant=minbase", RELEASES[match[1]], str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"debootstrap ended with {done.returncode}\n{done.stdout[-2000:]}")


def copy_network(root: Path) -> None:
    """Name servers of the host, as an engine copies them, and its certificates where pip was told some."""
    told = os.environ.get("PIP_CERT", "")
    for source, target in (("/etc/resolv.conf", "etc/resolv.conf"), (told, CERTIFICATES.lstrip("/"))):
        if source and Path(source).is_file():
            shutil.copyfile(source, root / target)


def build(text: str, image: Image) -> None:
    """Carry the instructions out, one after the other."""
    for name, rest in instructions(text)[1:]:
        print(f"{name} {' '.join(rest.split())[:100]}", flush=True)
        if name == "RUN":
            mount = re.match(r"--mount=type=bind,source=(\S+?),target=(\S+)\s+", rest)
            binds = [(ROOT / mount[1], mount[2])] if mount else []
            command = rest[mount.end() :] if mount else rest
            insist(image, ["/bin/sh", "-c", command], network=True, binds=binds)
        elif name == "ENV":
            image.environment |= dict(pair.split("=", 1) for pair in shlex.split(rest))
        elif name == "USER":
            image.user = rest
        elif name == "WORKDIR":
            image.folder = rest
            (image.root / rest.lstrip("/")).mkdir(parents=True, exist_ok=True)
        elif name == "VOLUME":
            image.volumes = json.loads(rest)
        elif name == "ENTRYPOINT":
            image.entry = json.loads(rest)


def try_out(image: Image, photo: Path) -> None:
    """Annotate the photo as the image's user, and see that it cannot change the program."""
    photos = image.root / image.folder.lstrip("/") / "photos"
    photos.mkdir()
    shutil.copyfile(photo, photos / photo.name)
    for copied in ("etc/resolv.conf", CERTIFICATES.lstrip("/")):
        (image.root / copied).unlink(missing_ok=True)
    who = insist(image, ["id", "-u"], network=False).strip()
    if who != "1000":
        sys.exit(f"the container runs as {who}")
    # With a network nothing is sealed, so this asks the rights of files.
    for place in ("/opt/cadpose/bin", "/usr/bin", "/etc"):
        if inside(image, ["touch", f"{place}/written"], network=True).returncode == 0:
            sys.exit(f"the container's user can write {place}")
    print(insist(image, [*image.entry, "--version"], network=False).strip())
    insist(image, [*image.entry, "doctor"], network=False)
    store = ("--store", "sqlite:///out/annotations.db")
    print(insist(image, [*image.entry, "annotate", "photos", "--out", "out", *store], network=False))
    document = image.root / "data/out" / f"{photo.stem}.json"
    found = json.loads(document.read_text(encoding="utf-8"))["annotations"]
    if not found or document.stat().st_uid != 1000:
        sys.exit(f"{len(found)} objects, written by user {document.stat().st_uid}")
    # What the review page would open.
    stored = json.loads(insist(image, [*image.entry, "db", "stats", "--json", *store], network=False))
    print(f"in the store: {stored}")
    print(f"{photo.name}: {len(found)} objects, first {found[0]['cad']['name']}")


def main() -> None:
    """Base, build, try."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--photo", type=Path, required=True, help="a photo with an object")
    parser.add_argument("--base", type=Path, help="a root that debootstrap made before")
    parser.add_argument("--work", type=Path, help="folder for the image; a temporary one unless told")
    options = parser.parse_args()
    if os.geteuid() != 0 or not all(map(shutil.which, ("debootstrap", "unshare", "chroot"))):
        sys.exit("it needs root, debootstrap, unshare and chroot")
    if len(list((ROOT / "dist").glob("*.whl"))) != 1:
        sys.exit("dist/ has to hold one wheel: make wheel")
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    name, image_name = instructions(text)[0]
    if name != "FROM":
        sys.exit("the first instruction is not FROM")
    with tempfile.TemporaryDirectory(dir=options.work, prefix="cadpose-container-") as folder:
        root = Path(folder) / "root"
        if options.base:
            subprocess.run(["cp", "-a", str(options.base), str(root)], check=True)
        else:
            base(image_name, root)
        copy_network(root)
        image = Image(root)
        build(text, image)
        size = subprocess.run(
            ["du", "-sm", str(root)], capture_output=True, text=True, check=True
        ).stdout.split()[0]
        print(f"{size} MB in all, Debian included")
        try_out(image, options.photo)


if __name__ == "__main__":
    main()
