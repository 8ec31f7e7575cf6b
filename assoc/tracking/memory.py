"""What a tracker was before a step, so that it can be again."""

from __future__ import annotations

from typing import Any, NamedTuple


class Memory(NamedTuple):
    """A tracker as it was once. Steps replace arrays and do not write to them, so that nothing need be copied."""

    values: dict[str, Any]
    rng: Any

    @classmethod
    def of(cls, tracker: Any) -> Memory:
        """Remember a tracker."""
        rng = getattr(tracker.filter, "rng", None)
        return cls(_with_own_lists(vars(tracker)), None if rng is None else rng.bit_generator.state)

    def restore(self, tracker: Any) -> None:
        """Make the tracker what it was; the memory stays good for another time."""
        vars(tracker).update(_with_own_lists(self.values))
        if self.rng is not None:
            tracker.filter.rng.bit_generator.state = self.rng

    @property
    def time(self) -> float | None:
        """Time of the last step before, seconds."""
        when: float | None = self.values["_time"]
        return when

    @property
    def next_id(self) -> int:
        """Tracks that began later have this id or a larger one."""
        return int(self.values["_next_id"])

    @property
    def track_ids(self) -> set[int]:
        """Ids of the tracks that lived."""
        return set(self.values["_batch"].track_id.tolist())


def _with_own_lists(values: dict[str, Any]) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, list) else value for name, value in values.items()}
