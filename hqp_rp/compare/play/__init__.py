"""A page to play with: drag a target, switch the solver while it runs, see what each level pays, record it."""
