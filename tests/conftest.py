"""What all tests share: property tests that draw the same examples on every run."""

from __future__ import annotations

from hypothesis import settings

# Without a deadline: a slow moment of a shared machine is no finding.
settings.register_profile("sheetoflight", derandomize=True, deadline=None)
settings.load_profile("sheetoflight")
