"""Settings of all tests."""

import os

from hypothesis import HealthCheck, settings

# Compiled kernels are built on their first call: how long an example takes says nothing about the code.
settings.register_profile("gearsig", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# In continuous integration the examples are the same each time: a change fails by what it changes, not by chance.
settings.register_profile("ci", settings.get_profile("gearsig"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "gearsig")
