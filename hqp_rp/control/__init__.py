"""Tasks, limits and stacks: what a robot should do, turned into a `Problem` at each control step."""
