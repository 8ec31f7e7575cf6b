"""The association of a scene's measurements: which came from the same target, scan by scan."""

from assoc.association.associate import associate
from assoc.association.association import Association
from assoc.association.link import Links, link
from assoc.association.scan import ScanAssociation

__all__ = ["Association", "Links", "ScanAssociation", "associate", "link"]
