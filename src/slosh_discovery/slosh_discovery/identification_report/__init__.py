"""The result of an identification as a document: text, page and `identification.json`."""

from slosh_discovery.identification_report.data import SCHEMA, Beside, IdentificationReport
from slosh_discovery.identification_report.document import identification_document

__all__ = ["SCHEMA", "Beside", "IdentificationReport", "identification_document"]
