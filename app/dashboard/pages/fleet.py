"""Many machines over time, the worst first."""

from __future__ import annotations

from app.dashboard import fleet
from app.dashboard.widgets.messages import show_error
from gearsig.errors import GearsigError

try:
    fleet.show()
except GearsigError as error:
    show_error(error)
