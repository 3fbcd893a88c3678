"""A node's logger, which obeys no control character that a stranger sends."""

from __future__ import annotations

from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger

from slosh_base.files.plain_text import plain_line


class PlainLogger(RcutilsLogger):
    """As rclpy's, with every message one plain line.

    One method for each severity: rclpy refuses two severities from one place in the sources.
    """

    def debug(self, message: str, **options: Any) -> bool:
        """As rclpy's."""
        return bool(super().debug(plain_line(message), **options))

    def info(self, message: str, **options: Any) -> bool:
        """As rclpy's."""
        return bool(super().info(plain_line(message), **options))

    def warning(self, message: str, **options: Any) -> bool:
        """As rclpy's."""
        return bool(super().warning(plain_line(message), **options))

    def error(self, message: str, **options: Any) -> bool:
        """As rclpy's."""
        return bool(super().error(plain_line(message), **options))

    def fatal(self, message: str, **options: Any) -> bool:
        """As rclpy's."""
        return bool(super().fatal(plain_line(message), **options))
