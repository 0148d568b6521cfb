"""Settings of all tests."""

from hypothesis import HealthCheck, settings

# Compiled kernels are built on their first call: how long an example takes says nothing about the code.
settings.register_profile("gearsig", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("gearsig")
