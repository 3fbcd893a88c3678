"""Monitors of a tray's containers other than the first, each with its own camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rclpy.node import Node

from slosh_estimator.azimuth import Surfaces, measured_waves
from slosh_estimator.comparison import Comparison, EstimatePoint, MeasuredPoint
from slosh_estimator.container_monitor import ContainerMonitor
from slosh_estimator.limits import Event
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.nodes.monitor_health import MonitorHealth
from slosh_model.tray import Tray
from slosh_motion.errors import SloshMotionError
from slosh_msgs.msg import FreeSurface, SloshComparison, TrayEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import ERROR, OK, Health
from slosh_msgs_py.stamps import to_nanoseconds


class _Camera(NamedTuple):
    """The monitor of one container that has its own camera, and the monitor's diagnostics."""

    monitor: ContainerMonitor
    health: MonitorHealth


class ContainerCameras:
    """Compares heights from all cameras except the first with their containers' estimates.

    Args:
        node: the monitor.
        names: of the containers, separated by commas; empty: there are no further cameras.
        number: gives each limit violation its number.
        arrival: returns the arrival time of what has come [ns].
        announce: publishes a limit event; it is also told the frame.

    Raises:
        SloshMessageError: no topic can carry a name.
    """

    def __init__(
        self,
        node: Node,
        names: str,
        number: Callable[[], int],
        arrival: Callable[[], int],
        announce: Callable[[Event, str], None],
    ) -> None:
        self._node, self._number = node, number
        self._arrival, self._announce = arrival, announce
        self._names = tuple(filter(None, (part.strip() for part in names.split(","))))
        self._cameras: dict[str, _Camera] = {}
        self._publishers: dict[str, Any] = {}
        self._counts: Counter[str] = Counter()
        self._complaint = ""
        for name in self._names:
            surfaces, comparisons = (
                topics.of_container(topic, name)
                for topic in (topics.FREE_SURFACE, topics.COMPARISON)
            )
            self._publishers[name] = node.create_publisher(
                SloshComparison, comparisons, qos.STREAM_OUT
            )
            node.create_subscription(
                FreeSurface, surfaces,
                lambda message, name=name: self._on_surface(name, message), qos.STREAM_IN,
            )  # fmt: skip

    def carry(self, tray: Tray | None, stamp_ns: int, settings: MonitorSettings) -> None:
        """Replaces the tray's containers after a stamp [ns]; None: no tray is held."""
        self._complaint = ""
        for name in self._names:
            try:
                self._carry(name, tray or Tray(()), stamp_ns, settings)
            except SloshMotionError as error:
                self._complaint = str(error)

    def _carry(self, name: str, tray: Tray, stamp_ns: int, settings: MonitorSettings) -> None:
        known = self._cameras.get(name)
        if known is not None and known.monitor.tray.names == tray.names:
            known.monitor.carry(tray, stamp_ns)
            return
        monitor = ContainerMonitor(tray, name, settings, self._number)
        if known is not None:
            self._cameras[name] = known._replace(monitor=monitor)
            known.health.watch(monitor.core)
            return
        surfaces = topics.of_container(topics.FREE_SURFACE, name)
        health = MonitorHealth(self._node, monitor.core, surfaces, topics.TRAY_ESTIMATE)
        self._cameras[name] = _Camera(monitor, health)

    def change_settings(self, settings: MonitorSettings, stamp_ns: int) -> None:
        """Changes the limits for heights after a stamp [ns]."""
        for camera in self._cameras.values():
            camera.monitor.change_settings(settings, stamp_ns)

    def reset(self) -> None:
        """Resets the accuracy statistics of all cameras except the first."""
        for camera in self._cameras.values():
            camera.monitor.core.reset_accuracy()

    def add_tray(self, message: TrayEstimate) -> None:
        """Passes a tray's estimates to the monitor of each camera; publishes the comparisons."""
        self._counts[topics.TRAY_ESTIMATE] += 1
        for camera in self._cameras.values():
            monitor = camera.monitor
            point = container_point(message, monitor.index)
            self._publish(camera, monitor.core.add_estimate(point, self._arrival()))

    def _on_surface(self, name: str, message: FreeSurface) -> None:
        self._counts[topics.of_container(topics.FREE_SURFACE, name)] += 1
        camera = self._cameras.get(name)
        if camera is not None:  # else no tray is announced yet
            point = measured_point(message)
            self._publish(camera, camera.monitor.core.add_measurement(point, self._arrival()))

    def check(self) -> None:
        """Checks the timeouts of all cameras except the first."""
        for camera in self._cameras.values():
            self._publish(camera, camera.monitor.core.check(self._arrival()))

    def _publish(self, camera: _Camera, comparisons: Sequence[Comparison]) -> None:
        name = camera.monitor.name
        for comparison in comparisons:
            fields = comparison._asdict()
            self._publishers[name].publish(filled(SloshComparison, frame_id=name, **fields))
        for event in camera.monitor.take_events():
            self._announce(event, name)

    def health(self, first: Health) -> Health:
        """Returns the worst health of all cameras; `first` is the first camera's health."""
        found = [first]
        for name, camera in self._cameras.items():
            surfaces = self._counts[topics.of_container(topics.FREE_SURFACE, name)]
            level, text = camera.health.look(self._arrival(), surfaces)
            found.append((level, f"camera of {name}: {text}"))
        if self._complaint:
            found.append((ERROR, self._complaint))
        worst = max(level for level, _ in found)
        if worst == OK:
            return first
        return worst, "; ".join(text for level, text in found if level == worst)

    def facts(self) -> dict[str, Any]:
        """Returns the accuracy at each camera except the first, for the diagnostics."""
        found: dict[str, Any] = {}
        for name, camera in self._cameras.items():
            core = camera.monitor.core
            found[f"camera of {name}: MAE NL [mm]"] = f"{1e3 * core.nonlinear.sigma:.2f}"
            found[f"camera of {name}: epsilon NL [%]"] = f"{1e2 * core.nonlinear.epsilon:.1f}"
            found[f"camera of {name}: measurements without an estimate"] = core.unmatched
            found |= {
                f"camera of {name}: {key}": value
                for key, value in camera.health.facts(self._counts).items()
            }
        return found


def container_point(message: TrayEstimate, index: int) -> EstimatePoint:
    """Returns the estimate of one container from a tray's estimates; `index` is from 0."""
    return EstimatePoint(
        to_nanoseconds(message.header.stamp),
        message.linear_msh[index],
        message.msh[index],
        message.flags[index],
        tuple(message.acceleration.tolist()),
        (message.linear_reading[index], message.reading[index]),
        round(message.delay[index] * 1e9),
        message.azimuth[index],
    )


def measured_point(message: FreeSurface) -> MeasuredPoint:
    """Returns the wall heights and the stamp from a camera node's FreeSurface message."""
    surfaces = Surfaces(*(getattr(message, name) for name in Surfaces._fields))
    (wave,), (axis,) = (column.tolist() for column in measured_waves(surfaces))
    return MeasuredPoint(
        to_nanoseconds(message.header.stamp), message.msh, message.msh_stddev, message.flags,
        wave, axis, float(surfaces.levels),
    )  # fmt: skip
