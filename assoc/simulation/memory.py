"""The memory of a scene, checked before it is made."""

from __future__ import annotations

from assoc._system import memory

# bytes, measured (tests/reliability/test_memory.py): of the arrays of a sensor in a scan however few it reports, of a
# measurement with its source, of a target in a scan with its position and its path, and of a sensor
_REPORT, _MEASUREMENT, _PLACE, _SENSOR = 1_000, 90, 150, 2_000
# scans, sensors or targets that a scenario takes at the most
MOST = 10_000_000


def require_scene_memory(scans: float, sensors: float, targets: float, false_alarms: float, names: str) -> None:
    """Refuse a scene that would take more memory than there is; the message names the parameter that asks for most.

    `false_alarms` is the mean number of a sensor in a scan; `names` are the caller's parameters in the order of these,
    separated by spaces.
    """
    needed = _SENSOR * sensors + scans * (
        sensors * (_REPORT + _MEASUREMENT * (float(targets) + false_alarms)) + _PLACE * targets
    )
    values = dict(zip(names.split(), (scans, sensors, targets, false_alarms), strict=True))
    given = ", ".join(f"{name} = {value:g}" for name, value in values.items())
    memory.require(needed, f"a scene with {given}", f"lower {max(values, key=lambda name: values[name])}")
