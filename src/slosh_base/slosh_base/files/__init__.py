"""Writes files and folders so that nothing which was there is destroyed; reads YAML strictly.

A package of its own, below all others, because what writes a bag, a table or a page should load
nothing else for it: the model's package would bring the compiler into the recorder's process, the
messages' package would bring ROS into the pure cores. YAML is in modules of its own,
`yaml_document` and `yaml_text`, so that only what reads or writes it loads PyYAML.
"""

from slosh_base.files.apart import check_apart, check_outside
from slosh_base.files.errors import SloshFileError
from slosh_base.files.new_file import NewFile, naming, new_link, new_text, write_bytes, write_text
from slosh_base.files.new_folder import check_free, is_unfinished, new_folder, remove_unfinished

__all__ = [
    "NewFile",
    "SloshFileError",
    "check_apart",
    "check_free",
    "check_outside",
    "is_unfinished",
    "naming",
    "new_folder",
    "new_link",
    "new_text",
    "remove_unfinished",
    "write_bytes",
    "write_text",
]
