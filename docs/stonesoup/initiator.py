"""Tracks for JPDA and for multi-frame assignment, from an initiator that takes both as they are."""

from scene import deleter, make, pda, prior, show, updater
from stonesoup.dataassociator.mfa import MFADataAssociator
from stonesoup.dataassociator.probability import JPDA
from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.initiator.simple import GaussianMixtureInitiator
from stonesoup.tracker.simple import MultiTargetMixtureTracker
from stonesoup.types.update import GaussianMixtureUpdate

from assoc.integrations.stonesoup import AssignmentInitiator


def multi_frame(stream, associator, initiator):
    """What Stone Soup has no tracker for: mixtures stay mixtures."""
    tracks = set()
    for now, detections in stream:
        used = set()
        for track, hypotheses in associator.associate(tracks, detections, now).items():
            used |= {one.measurement for one in hypotheses if one}
            components = [updater.update(one) if one else one.prediction for one in hypotheses]
            track.append(GaussianMixtureUpdate(hypothesis=hypotheses, components=components))
        tracks -= deleter.delete_tracks(tracks)
        tracks |= initiator.initiate(detections - used, now)
        yield now, tracks


def ways(seed):
    """JPDA, and MFA over three scans."""
    stream, paths = make(seed)
    jpda, mfa = JPDA(pda), MFADataAssociator(MFAHypothesiser(pda), slide_window=3)
    initiator = AssignmentInitiator(prior, deleter, jpda, updater, min_points=7)
    yield "Stone Soup's JPDA", MultiTargetMixtureTracker(initiator, deleter, stream, jpda, updater), paths
    initiator = AssignmentInitiator(prior, deleter, mfa, updater, min_points=7)
    yield "Stone Soup's MFA", multi_frame(stream, mfa, GaussianMixtureInitiator(initiator)), paths


if __name__ == "__main__":
    show(ways)
