"""The figures of the claims report, from the rows of all trials and the curves of a few.

`curves` holds the drawn runs and `styles` how each method is drawn; the others draw, each its own subject, and `evidence` puts
all into sections. Titles and captions are in the template beside them.
"""
