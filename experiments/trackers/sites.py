"""Sites that send tracks and no measurements: a tracker for each sensor, and one picture of their tracks."""

from typing import Any

from assoc._types import Array
from assoc.scene import Scene
from assoc.tracking import MultiSensorTracker, Track
from assoc.tracking.filter_choice import manoeuvre_noise, open_heights, pace_of, two_speeds
from assoc.tracking.fusion import SystemTracks, TrackFusion


class Sites:
    """Takes measurements as a tracker does, and hands out fused tracks."""

    def __init__(self, scene: Scene, **options: Any) -> None:
        noise = manoeuvre_noise(pace_of(scene.times))
        options = {"filter": two_speeds(noise, unscented=open_heights(scene.sensors))} | options
        self.sites = [MultiSensorTracker([sensor], region=scene.region, **options) for sensor in scene.sensors]
        self.fusion, self.filter = TrackFusion(len(self.sites)), options["filter"]
        self.tracks: list[Track] = []

    def step(self, time: float, measurements: Any, times: Any = None, sectors: Array | None = None) -> None:
        """Step each site, and fuse the tracks that they report."""
        found = []
        for s, site in enumerate(self.sites):
            own = None if times is None else [times[s]]
            site.step(time, [measurements[s]], own, None if sectors is None else sectors[s : s + 1])
            found.append(SystemTracks.of([track for track in site.tracks if track.reported], site.filter.motion))
        self.tracks = self.fusion.step(time, found).tracks
