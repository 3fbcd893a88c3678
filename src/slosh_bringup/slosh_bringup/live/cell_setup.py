"""The configuration of a running cell: its files, topics and nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slosh_bag.mcap_files.remote_path import is_url
from slosh_bag.store.motion_ingest import PARAMETER as MOTIONS
from slosh_base.addons import cell_nodes
from slosh_base.files.errors import SloshFileError
from slosh_base.files.file_version import CELL, read_versioned
from slosh_base.files.nearest import did_you_mean
from slosh_base.files.yaml_document import YamlDocument, shown
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import NodeProcess, config_folder
from slosh_model.tray import read_tray
from slosh_msgs_py import topics
from slosh_msgs_py.errors import SloshMessageError

NAMESPACE = topics.NAMESPACE
NODES_OF_A_CELL = ("recorder", "estimator", "camera", "sensor", "monitor")
"""In the order of their start: what the recorder records must not have begun."""
REMAPPABLE = (
    *(topic.name for topic in topics.TOPICS if topic.remappable),
    *(one.name for one in (*topics.SERVICES, *topics.ACTIONS) if one.remappable),
)
"""Topics and services of the nodes, by the names that `remap` knows."""
ROBOT = ("urdf", "tool_frame")
READING = ("input", *ROBOT)
"""Keys of a cell file that are the estimator's parameters of the same name."""
EVENTS = "events"
RECORD = ("complete", EVENTS)
"""Values of `record`, the recorder's parameter `mode`."""


@dataclass(frozen=True, slots=True)
class CellSetup:
    """Files, topics and node settings of a cell, as cell.yaml gives them.

    Attributes:
        model: model file of the container and its liquid.
        calibration: camera.yaml of the only or first container; None: it has no camera, by choice.
        parameters: ROS parameter file of all nodes; what it does not set is as the nodes have it.
        namespace: of all nodes.
        remap: relative topic -> the robot's topic.
        reading: parameters of the estimator that say what drives it, as far as they are given.
        markers: whether the surface is published for RViz and Foxglove.
        hardware_id: of the cell in diagnostics, such as a serial number; empty: its namespace.
        force: identification.json of the payload on a force sensor; None: there is none.
        cameras: camera.yaml of each container behind a tray's first that has a camera, by name.
        record: of RECORD; empty: as the recorder's parameters have it.
        store_motions: folder or URL of the store that gets the recording's motions at its end, the
            recorder's parameter of that name; empty: as the recorder's parameters have it.
        added: what is given for each node of an add-on that is started, by its key.
        parameters_of: further parameters by node.
    """

    model: Path
    calibration: Path | None
    parameters: Path
    namespace: str = NAMESPACE
    remap: Mapping[str, str] = field(default_factory=dict)
    reading: Mapping[str, str] = field(default_factory=dict)
    record: str = ""
    force: Path | None = None
    markers: bool = False
    hardware_id: str = ""
    cameras: Mapping[str, Path] = field(default_factory=dict)
    added: Mapping[str, str] = field(default_factory=dict)
    parameters_of: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    store_motions: str = ""

    @property
    def camera_nodes(self) -> dict[str, str]:
        """Names of the nodes of further cameras, by container name."""
        return {container: f"camera_{container}" for container in self.cameras}

    def processes(self, bag: Path) -> list[NodeProcess]:
        """Returns the cell's node processes; no camera or sensor node without its file."""
        recorder = {"output": str(bag), "mode": self.record, MOTIONS: self.store_motions}
        own: dict[str, dict[str, str]] = {
            "recorder": {key: value for key, value in recorder.items() if value},
            "estimator": {"model": str(self.model), **self.reading},
            "camera": {"calibration": str(self.calibration)},
            "monitor": {},
        }
        if self.force is not None:
            beside = str(self.calibration is not None).lower()
            own["sensor"] = {"payload": str(self.force), "beside_camera": beside}
        if self.calibration is None:
            del own["camera"]
        if self.calibration is None and self.force is None:
            own["monitor"] = {"camera": "false"}
        if self.cameras:
            own["monitor"]["cameras"] = ",".join(self.cameras)
        names = [name for name in NODES_OF_A_CELL if name in own]
        for node, parameters in self._of_add_ons().items():
            own[node] = parameters
            names.append(node)
        if self.markers:
            own["markers"] = {}
            names.append("markers")
        for node, further in self.parameters_of.items():
            own[node] |= further
        for container, name in self.camera_nodes.items():
            own[name] = {"calibration": str(self.cameras[container]), "container": container}
            names.insert(names.index("monitor"), name)
        return [NodeProcess(name, [self.parameters], own[name], self.remap) for name in names]

    def _of_add_ons(self) -> dict[str, dict[str, str]]:
        """Returns the parameters of each node of an add-on that is started."""
        known = {"model": str(self.model), **self.reading}
        found = {}
        for key, given in self.added.items():
            node = cell_nodes()[key]
            found[node.node] = {name: known[name] for name in node.takes if name in known}
            if node.parameter:
                found[node.node][node.parameter] = given
        return found


def default_setup() -> CellSetup:
    """Returns the shipped set-up of the simulated cell."""
    folder = config_folder()
    return CellSetup(folder / "model.yaml", folder / "camera.yaml", folder / "cell.yaml")


def read_setup(path: Path) -> CellSetup:
    """Reads a cell's set-up from a YAML file; paths in it are relative to the file.

    Raises:
        SloshBringupError: no such file, no YAML, an unknown key, a missing file; one line with
            the file, the line and the key.
    """
    try:
        source = read_versioned(path, CELL)
    except SloshFileError as error:
        raise SloshBringupError(str(error)) from None
    document = source.value
    if not isinstance(document, dict):
        raise SloshBringupError(f"{path}: must be a mapping with the keys model and calibration")
    known = (
        "model",
        "calibration",
        "camera",
        "parameters",
        "namespace",
        "remap",
        "record",
        "force",
        "markers",
        "hardware_id",
        MOTIONS,
        *READING,
        *cell_nodes(),
    )
    for key in document:
        if key not in known:
            raise SloshBringupError(
                f"{source.where(key)}: unknown key {shown(key)} (known: {', '.join(known)}; "
                f"others need their add-on){did_you_mean(key, known)}"
            )
    default = default_setup()
    namespace = read_namespace(source, document.get("namespace", NAMESPACE))
    model = _file(source, "model")
    cameras = read_cameras(source, model) if _has_camera(source) else {}
    calibration = cameras.pop("", None)
    return CellSetup(
        model=model,
        calibration=calibration,
        cameras=cameras,
        parameters=_file(source, "parameters", default.parameters),
        namespace=namespace,
        remap=read_remap(source, namespace, document.get("remap") or {}, tuple(cameras)),
        reading=_reading(source),
        record=_one_of(source, "record", RECORD),
        added=_added(source),
        force=_file(source, "force") if "force" in document else None,
        markers=_flag(source, "markers"),
        hardware_id=_hardware_id(source),
        store_motions=_store(source),
    )


def _one_of(source: YamlDocument, key: str, known: Sequence[str]) -> str:
    """Returns a key's value, or "" without the key; raises an error for a value not in `known`."""
    value = source.value.get(key, "")
    if key in source.value and value not in known:
        raise SloshBringupError(f"{source.at(key)} = {shown(value)} must be {' or '.join(known)}")
    return str(value)


def _added(source: YamlDocument) -> dict[str, str]:
    """Returns what the cell file gives for the nodes of add-ons, by key."""
    found = {}
    for key, node in cell_nodes().items():
        if node.choices:
            given = _one_of(source, key, node.choices)
        else:
            given = "true" if _flag(source, key) else ""
        if given:
            found[key] = given
    return found


def _store(source: YamlDocument) -> str:
    """Returns the fleet store named in the cell file; a folder is relative to that file."""
    value = source.value.get(MOTIONS, "")
    if not isinstance(value, str) or "\0" in value:
        raise SloshBringupError(
            f"{source.at(MOTIONS)} = {shown(value)} must be a folder or a URL, such as "
            "s3://bucket/motions"
        )
    if not value or is_url(value):
        return value
    return str((Path(source.source).parent / value).resolve())


def _flag(source: YamlDocument, key: str) -> bool:
    """Returns the value of a key that is true or false; false if the cell file lacks the key."""
    value = source.value.get(key, False)
    if not isinstance(value, bool):
        raise SloshBringupError(f"{source.at(key)} = {shown(value)} must be true or false")
    return value


def _hardware_id(source: YamlDocument) -> str:
    """Returns the cell's name or serial number for diagnostics; empty if the file has none."""
    value = source.value.get("hardware_id", "")
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise SloshBringupError(f"{source.at('hardware_id')} = {shown(value)} must be a text")
    return str(value)


def _reading(source: YamlDocument) -> dict[str, str]:
    """Returns the cell file's settings of the estimator's input."""
    found = {}
    for key in READING:
        if key not in source.value:
            continue
        value = source.value[key]
        if not isinstance(value, str):
            raise SloshBringupError(f"{source.at(key)} = {shown(value)} must be a text")
        found[key] = str(_file(source, key)) if key == "urdf" else value
    if "input" in found and found["input"] not in topics.DRIVING:
        raise SloshBringupError(
            f"{source.at('input')} = {shown(found['input'])} must be {', '.join(topics.DRIVING)}"
        )
    return found


def _has_camera(source: YamlDocument) -> bool:
    """Whether the cell file names a calibrated camera and does not say `camera: none`."""
    camera = source.value.get("camera", "")
    if "camera" in source.value and camera not in ("none", None, False):
        raise SloshBringupError(
            f"{source.at('camera')}: camera = {shown(camera)} must be none, or be left out: the "
            "key calibration names the camera's file"
        )
    return "camera" not in source.value and "calibration" in source.value


def read_cameras(source: YamlDocument, model: Path) -> dict[str, Path]:
    """Returns the camera files by container name; the first or only container has no name.

    The key `calibration` names the file of the first container's camera, or maps names of a
    tray's containers to the files of their cameras.

    Raises:
        SloshBringupError: a file or a container is not there, or no topic can carry its name.
    """
    value = source.value["calibration"]
    if not isinstance(value, dict):
        return {"": _file(source, "calibration")}
    names, found = read_tray(model).names, {}
    for name in value:
        place = source.where("calibration", name)
        if names == ("",) or name not in names:
            known = "it carries no tray" if names == ("",) else f"known: {', '.join(names)}"
            raise SloshBringupError(f"{place}: calibration: no container {shown(name)} ({known})")
        own = "" if name == names[0] else str(name)
        try:
            topics.of_container(topics.FREE_SURFACE, own)
        except SloshMessageError as error:
            raise SloshBringupError(f"{place}: {error}") from None
        found[own] = _file(source, "calibration", name=name)
    return found


def _file(
    source: YamlDocument, key: str, default: Path | None = None, name: str | None = None
) -> Path:
    """Returns the path of the file that a key, or an entry under it, gives in the cell file."""
    value = source.value.get(key, default)
    value = value if name is None else value[name]
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise SloshBringupError(f"{source.where(key)}: key {key!r} is missing or not a path")
    path = Path(source.source).parent / value
    try:
        there = path.is_file()
    except OSError as error:  # of a name that is too long
        raise SloshBringupError(f"{source.at(key)}: {shown(value)}: {error.strerror}") from None
    if not there:
        raise SloshBringupError(f"{source.at(key)}: no such file: {path}")
    return path.resolve()


def read_namespace(source: YamlDocument, value: Any) -> str:
    """Checks and returns the namespace of a cell.

    Raises:
        SloshBringupError: it is none; one line with its place.
    """
    if not isinstance(value, str) or not value.startswith("/"):
        place = source.where("namespace")
        raise SloshBringupError(f"{place}: namespace = {shown(value)} must start with a slash")
    return value


def read_remap(
    source: YamlDocument, namespace: str, value: Any, cameras: Sequence[str] = ()
) -> dict[str, str]:
    """Checks and returns the mapping from the cell's topics to the robot's topics.

    Args:
        source: the cell file.
        namespace: of the cell.
        value: of the key `remap`.
        cameras: names of the containers behind a tray's first that have a camera.

    Raises:
        SloshBringupError: it is no mapping, or no node has such a topic; one line with its place.
    """
    if not isinstance(value, dict) or not all(
        isinstance(word, str) for pair in value.items() for word in pair
    ):
        raise SloshBringupError(
            f"{source.where('remap')}: remap must map topic names to topic names"
        )
    further = [
        topics.of_container(name, camera) for camera in cameras for name in topics.PER_CONTAINER
    ]
    remappable = (*REMAPPABLE, *further)
    for name in value:
        relative = name.removeprefix(f"{namespace.rstrip('/')}/")
        if not {relative, f"/{relative}"} & {*remappable}:
            known = ", ".join(remappable)
            place = source.where("remap", name)
            raise SloshBringupError(
                f"{place}: remap: no such topic: {shown(name)} (known: {known})"
                f"{did_you_mean(relative, remappable)}"
            )
    whole = {name.strip("/") for name in REMAPPABLE if name.startswith("/")}
    return {f"/{name}" if name in whole else name: other for name, other in value.items()}
