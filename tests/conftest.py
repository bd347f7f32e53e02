"""How much property tests try: the same few examples every day, thousands of others with PROXBENCH_PROFILE=full."""

import os

from hypothesis import settings

settings.register_profile("quick", max_examples=40, deadline=None, derandomize=True)  # a failure comes back
settings.register_profile("full", max_examples=500, deadline=None)
settings.load_profile("full" if os.environ.get("PROXBENCH_PROFILE") == "full" else "quick")
