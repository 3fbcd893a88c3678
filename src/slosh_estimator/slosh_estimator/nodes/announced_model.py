"""The model that the estimator announces with its settings."""

from __future__ import annotations

from slosh_base.files.yaml_document import parse_yaml
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_msgs.msg import NodeSettings


def announced_model(message: NodeSettings) -> Model | None:
    """What an estimator's announcement says that it runs.

    None: it is another node's, or a stranger's that cannot be read.
    """
    if message.node != "estimator":
        return None
    try:
        document = parse_yaml(message.document, "settings of the estimator").value
        return parse_model(document["files"]["model"], "the estimator's model")
    except (KeyError, TypeError, ValueError):
        return None
