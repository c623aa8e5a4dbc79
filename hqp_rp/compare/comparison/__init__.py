"""The comparison: every solver on every scenario, and what follows from it.

What flows: `record` holds what a comparison found, `findings` rule on the cases that `measure` and `limits` made, in
sentences; `figures` draw them, `opening` picks what is said first, `report` puts the page together, and `comparison` runs
what is missing and writes all of it.
"""
