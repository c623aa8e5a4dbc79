"""What the runs say of each claim: outcomes by condition, the one number, and the algebra behind.

`study` holds the rows by what they are, `criteria` the thresholds; the others judge, each its own subject. Their sentences are
in the template beside them.
"""
