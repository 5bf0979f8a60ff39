"""What the coder of faces has learnt: anew for each level, or, where faces are coded deeply, kept for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.faces_choices import Choices
from meshtide_codec.reference.faces_deep import INPUTS, DeepChoices, DeepScores, LevelScores
from meshtide_codec.reference.faces_scores import Scores
from meshtide_codec.reference.trained_states import connectivity_states, deep_connectivity_states

if TYPE_CHECKING:
    from meshtide_codec.reference.faces_coarse import CoarseMesh
    from meshtide_codec.reference.faces_mesh import FineMesh
    from meshtide_codec.reference.range_decoder import RangeDecoder


class FaceStates:
    """States as trained, with or without positions."""

    def __init__(self, *, geometric: bool) -> None:
        self._neurons, self._scores = connectivity_states(geometric=geometric)

    def scores_of(self, _coarse: CoarseMesh, fine: FineMesh) -> Scores | LevelScores:
        """The scores of one level's candidates."""
        return Scores(self._scores, fine)

    def choices_from(self, decoder: RangeDecoder) -> Choices:
        """Where decisions come from."""
        return Choices(decoder, self._neurons)


class DeepFaceStates(FaceStates):
    """States as trained for faces that are coded deeply, which have positions."""

    def __init__(self) -> None:
        super().__init__(geometric=True)
        scores, counts, self._deep_neurons = deep_connectivity_states(INPUTS)
        self._deep_scores = DeepScores(scores, counts)

    def scores_of(self, coarse: CoarseMesh, fine: FineMesh) -> LevelScores:
        """The scores of one level's candidates."""
        if fine.shapes is None:
            raise ValueError("deep models need positions")
        return LevelScores(self._deep_scores, coarse, fine, fine.shapes)

    def choices_from(self, decoder: RangeDecoder) -> DeepChoices:
        """Where decisions come from."""
        return DeepChoices(decoder, self._neurons, self._deep_neurons)
