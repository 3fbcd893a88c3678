"""The result of a discovery as a document: terminal text, page and `discovery.json`."""

from slosh_discovery.discovery_report.data import SCHEMA, Command, DiscoveryReport
from slosh_discovery.discovery_report.document import discovery_document

__all__ = ["SCHEMA", "Command", "DiscoveryReport", "discovery_document"]
