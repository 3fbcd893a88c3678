"""Launch files, parameters, the simulated cell and the slosh command."""
