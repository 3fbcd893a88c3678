"""The base of all packages: files and YAML (`files`), compiled code (`compiled`).

Neither part imports the other; a recorder loads no compiler, a core no YAML.
"""
