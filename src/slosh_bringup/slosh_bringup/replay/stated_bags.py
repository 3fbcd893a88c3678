"""Bags on the command line, and what the manifests beside them state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from slosh_bag.reader import bag_files
from slosh_bringup.errors import SloshBringupError
from slosh_replay.manifest import NAME, Expectation, read_manifest


@dataclass(frozen=True, slots=True)
class StatedBag:
    """A bag and its place in a manifest.

    Attributes:
        path: folder or file.
        manifest: where it is or would be stated; the file may not exist.
        key: its name there.
        expected: what is stated; None: nothing.
        unstated: the folder's manifest names other bags and not this one.
    """

    path: Path
    manifest: Path
    key: str
    expected: Expectation | None = None
    unstated: bool = False


def find_bags(paths: Sequence[Path], output: Path | None = None) -> list[StatedBag]:
    """The bags that are meant, each once.

    Args:
        paths: bags, and folders of bags with or without a manifest.
        output: folder of results; bags in it are none that are meant.

    Raises:
        SloshBringupError: there is nothing at a path.
        SloshBagError: a folder holds no bag, or a manifest cannot be read.
    """
    found: dict[Path, StatedBag] = {}
    for path in paths:
        if not path.exists():
            raise SloshBringupError(f"{path}: no such file or folder")
        for bag in _of_folder(path, output) if _is_collection(path) else [_single(path)]:
            found.setdefault(bag.path.resolve(), bag)
    return list(found.values())


def _is_collection(path: Path) -> bool:
    """A folder that holds files of its own is a bag, unless a manifest names them."""
    return path.is_dir() and ((path / NAME).is_file() or not any(path.glob("*.mcap")))


def _single(path: Path) -> StatedBag:
    """A bag, with what the manifest beside it states."""
    manifest = path.resolve().parent / NAME
    stated = read_manifest(manifest) if manifest.is_file() else {}
    return StatedBag(path, manifest, path.resolve().name, stated.get(path.resolve().name))


def _of_folder(folder: Path, output: Path | None) -> list[StatedBag]:
    manifest = folder / NAME
    stated: Mapping[str, Expectation] = read_manifest(manifest) if manifest.is_file() else {}
    bags = {path.parent for path in folder.glob("**/*.mcap") if path.parent != folder}
    bags |= set(folder.glob("*.mcap"))
    if output is not None:
        bags = {bag for bag in bags if output.resolve() not in bag.resolve().parents}
    bags |= {folder / name for name in stated}
    if not bags:
        bag_files(folder)  # says what is there instead
    keys = {bag.relative_to(folder).as_posix(): bag for bag in sorted(bags)}
    return [
        StatedBag(bag, manifest, key, stated.get(key), manifest.is_file() and key not in stated)
        for key, bag in keys.items()
    ]
