"""The association of a scene's measurements: which came from the same target, scan by scan."""

from assoc.association.association import Association, ScanAssociation, associate

__all__ = ["Association", "ScanAssociation", "associate"]
