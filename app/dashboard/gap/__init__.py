"""The gap page: from recordings and a simulator to the effect that is missing in it."""

from app.dashboard.gap.view import show

__all__ = ["show"]
