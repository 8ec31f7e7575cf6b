"""From one part of a root that is split on counts to the next."""

from __future__ import annotations

from assoc.packing.branching.counts import Leaf, with_counts
from assoc.packing.branching.node import Work, knowing, new_work
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.packing import Packing


def begin_leaf(packing: Packing, leaf: Leaf, given_up: float, work: Work | None) -> tuple[OpenNodes, Work]:
    """The open nodes of a leaf, which are its root alone, and room for its search.

    Parameters
    ----------
    packing : Packing
    leaf : Leaf
    given_up : float
        What the open nodes before say of nodes that were given up.
    work : Work or None
        The room of the search before, which is used again where it fits.
    """
    root, program = leaf.root, leaf.root.program
    nodes = OpenNodes(root)
    nodes.arrays.bound[0] = leaf.bound
    nodes.given_up = given_up
    if work is None or work.program.rows is not program.rows:
        new = new_work(with_counts(packing.arrays, program), program, root.slack)
        if work is not None:
            # what is known of pairs stays true
            new = knowing(new, work.trials)
        work = new
    # the programs of one split differ in their right-hand sides alone
    return nodes, work._replace(program=program)
