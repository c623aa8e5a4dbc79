"""Settings of every test."""

import hypothesis

# How long one example takes says nothing on a shared machine.
hypothesis.settings.register_profile("unhurried", deadline=None)
hypothesis.settings.load_profile("unhurried")
