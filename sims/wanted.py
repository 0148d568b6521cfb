"""Complete values of the parameters, read by kind."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.errors import InputError
from sims.values import Values


@dataclass(frozen=True)
class Wanted:
    """Values as `sims.values.complete_values` returns them."""

    values: Values

    def number(self, name: str) -> float:
        """Value of a number that always has one."""
        value = self.optional(name)
        if value is None:
            raise InputError(f"{name} has no value", remedy="complete the values first")
        return value

    def optional(self, name: str) -> float | None:
        """Value of a number, None where it follows from the others."""
        value = self.values[name]
        if isinstance(value, str):
            raise InputError(f"{name} is {value!r}", allowed="a number")
        return value

    def whole(self, name: str) -> int:
        """Value of a whole number."""
        return round(self.number(name))

    def word(self, name: str) -> str:
        """Value of a word."""
        return str(self.values[name])

    def is_on(self, name: str) -> bool:
        """Whether a switch is on."""
        return self.word(name) == "on"
