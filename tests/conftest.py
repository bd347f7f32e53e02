"""How much property tests try: the same few examples every day, others with PROXBENCH_PROFILE=full or hunt."""

import os

from hypothesis import settings

settings.register_profile("quick", max_examples=40, deadline=None, derandomize=True)  # a failure comes back
settings.register_profile("full", max_examples=500, deadline=None)
settings.register_profile("hunt", max_examples=5000, deadline=None)
settings.load_profile({"full": "full", "hunt": "hunt"}.get(os.environ.get("PROXBENCH_PROFILE", ""), "quick"))
