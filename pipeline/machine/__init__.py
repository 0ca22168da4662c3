"""The machine: stages, their plan, the runner, and the folder and store that keep their results."""
