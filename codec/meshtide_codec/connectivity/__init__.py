"""Connectivity: the triangles of a level, given the coarser level that it collapses to.

Written down so that a second decoder can be made from it; each step names the module that has the details.

**What both sides know.** The parent of each fine vertex, the coarse faces, the number of fine faces, and, in profile
compact, a position for each fine vertex (the centre of its cell in half cells). Children of a coarse vertex are
consecutive. A coarse vertex with several children is *split*.

1. **Copied faces** (`coarse_kernels`). A coarse face whose corners are all unsplit has exactly one fine face above it,
   the one of the three only children. These come first, in the order of the coarse faces, and cost nothing.
2. **Gates** (`gate_kernels`, `half_edge_kernels`). Half-edges are numbered in the order in which they are made, three
   for each triangle. One whose other side may hold a face is *open*: a gate. The first pass visits open half-edges in
   the order of their numbers, also those made meanwhile. The face across a gate has the gate's two ends and an *apex*.
   - *Candidates* for the apex (`candidate_kernels`): a fine face collapses to a coarse face, a coarse edge or a point,
     so its apex is a child of the third corner of a coarse face at the coarse edge below the gate, or a sibling of an
     end. If both ends share their parent: a sibling, or a child of a coarse neighbour.
   - *Scores* (`score_kernels`, `shape_kernels`): each candidate gets a sum of integers from a trained table: its kind,
     how many edges its face would close, valences, and with positions angles, lengths and the bend at the gate.
     Exponentials of the scores are weights. Scores then move towards what was chosen, if that was a surprise.
   - *Decisions* (`decision_kernels`): first, has the gate a face with one of these candidates? Then, candidate by
     candidate from the greatest weight on, is it this one? Each answer is coded with two adaptive contexts, one for
     the odds that the weights give, one for the kind of candidate, weighed in the logistic domain.
   - A gate whose weights leave much doubt stays open in the first pass, since faces found later may settle it. When
     the first pass has nothing left, the second pass asks the next such gate for good.
   - Candidates that would give an edge a third face, or repeat a directed edge, are *blocked*: they are asked for only
     if no other candidate is right. A gate without a face is a border from then on.
3. **Extra faces** (`extra_face_kernels`). When no gate is left: at each edge that has a face, is there another one?
4. **Seeds** (`seed_kernels`). When no extra face is left: a coarse face that has no fine face above it yet must have
   one. Its corners are chosen one by one among the children of the coarse corners.
5. **Leftovers** (`seed_kernels`). What nothing else reaches: for each vertex of a split family, has it another face?
   Its other corners are chosen from a list of vertices around it, or given by their distance in the vertex order.

At effort high, steps 2 and 3 ask the same questions but expect the answers with more knowledge (`choice_kernels` is
where the two part): more properties of each candidate (`property_deep_kernels`), finer scores (`score_deep_kernels`)
and deep mixing (`decision_deep_kernels`). Gates then wait for up to nine passes, the surest first, and what is learnt
is kept from level to level.

After every face that steps 3 to 5 add, the traversal goes back to step 2. It ends when all faces are known.

Two bits at the start of a payload announce that a level is *closed* (every gate has a face, so nobody asks) or *clean*
(steps 3 and 5 and blocked candidates are not needed); the encoder finds out by trying. Lists, scans and windows have
fixed limits, so the time is linear in the size of the level even for hostile meshes and streams; what the limits hide
is found by step 5. Any set of distinct oriented triangles round-trips, manifold or not.

The method is a relative of gate-based coders such as Touma & Gotsman, "Triangle mesh compression", 1998, and
Alliez & Desbrun, "Valence-driven connectivity encoding", 2001, with the coarse level as the source of candidates.
"""

from meshtide_codec.connectivity.codec import read_faces, write_faces
from meshtide_codec.connectivity.tables import new_models

__all__ = ["new_models", "read_faces", "write_faces"]
