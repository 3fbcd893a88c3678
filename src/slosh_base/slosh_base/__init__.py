"""Foundation of all packages: files and YAML (`files`), compiled code (`compiled`), types.

Neither part imports the other; a recorder loads no compiler, a core no YAML.
"""
