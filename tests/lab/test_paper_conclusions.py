from __future__ import annotations

from typing import Any

import pytest

from meshtide_lab.paper.conclusions import SENTENCES
from meshtide_lab.paper.norm_experiment import NORMS
from paper_results import RATES, invented_mesh

SPHERE_RATES = {"zeroth": 24.0, "gaussian": 18.4, "degree 1": 16.2, "degree 3": 11.3}
ALIKE = {"zeroth": 17.7, "gaussian": 17.6, "degree 1": 16.8, "degree 3": 16.7}
APART = {"zeroth": 16.0, "gaussian": 30.0, "degree 1": 16.8, "degree 3": 16.9}
FALLING = {"zeroth": 4e-3, "gaussian": 3e-3, "degree 1": 2e-3, "degree 3": 1e-3}
RISING = {"zeroth": 1e-3, "gaussian": 2e-3, "degree 1": 3e-3, "degree 3": 4e-3}
L1, NEARLY_L1, BETWEEN, L2, MAXIMUM = NORMS


def norms_won_by(winner: str) -> dict[str, float]:
    return {norm: 1.0 if norm == winner else 2.0 for norm in NORMS}


CASES: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"multi": RATES}, {"multi": SPHERE_RATES}),
    ({"multi": RATES}, {"multi": SPHERE_RATES}),
    ({"multi": SPHERE_RATES}, {"multi": RATES}),
    ({"multi": RATES}, {"multi": SPHERE_RATES}),
    ({"multi": RATES, "single": ALIKE}, {"multi": SPHERE_RATES, "single": ALIKE}),
    ({"single": ALIKE}, {"single": APART}),
    ({"single": ALIKE}, {"single": APART}),
    ({"errors": FALLING}, {"errors": RISING}),
    ({"errors": FALLING, "single": ALIKE}, {"errors": RISING, "single": ALIKE}),
    ({"gaps": {"gaussian": 0.3}}, {"gaps": {"zeroth": 0.3}}),
    ({"multi": {"degree 5": 14.0, "degree 7": 13.9}}, {"multi": {"degree 5": 14.0, "degree 7": 13.0}}),
    ({"norms": norms_won_by(MAXIMUM)}, {"norms": norms_won_by(L2)}),
    ({"norms": norms_won_by(MAXIMUM)}, {"norms": norms_won_by(L2)}),
    ({"norms": norms_won_by(L2)}, {"norms": norms_won_by(L1)}),
    ({"noises": FALLING}, {"noises": RISING}),
    ({"norms": norms_won_by(BETWEEN)}, {"norms": norms_won_by(MAXIMUM)}),
]
"""For each sentence, figures with which it holds and figures with which it does not."""


@pytest.mark.parametrize("number", range(len(SENTENCES)))
def test_a_sentence_holds_or_not_as_the_figures_say(number: int) -> None:
    agreeing, contradicting = CASES[number]
    assert SENTENCES[number].find(invented_mesh(**agreeing)).holds
    assert not SENTENCES[number].find(invented_mesh(**contradicting)).holds


def test_every_sentence_has_its_case_and_its_figures() -> None:
    assert len(CASES) == len(SENTENCES)
    mesh = invented_mesh()
    for sentence in SENTENCES:
        assert any(letter.isdigit() or letter == "<" for letter in sentence.find(mesh).figures), sentence
