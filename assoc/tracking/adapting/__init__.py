"""What a tracker learns about its sensors and targets while it tracks, and the settings that follow from it."""
