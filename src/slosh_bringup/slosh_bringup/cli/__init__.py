"""The `slosh` command: one module per subcommand."""
