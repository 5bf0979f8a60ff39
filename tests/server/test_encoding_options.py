import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.effort import Effort
from meshtide_codec.errors import OptionError
from meshtide_server.encoding_options import EncodingOptions

CHOICES = st.one_of(
    st.builds(EncodingOptions, st.integers(4, 20), st.just("compact"), st.sampled_from(Effort)),
    st.builds(EncodingOptions, st.integers(4, 20), st.just("classic")),
)


@given(CHOICES)
def test_a_job_keeps_them(options: EncodingOptions) -> None:
    assert EncodingOptions.from_plain(json.loads(json.dumps(options.plain()))) == options


@pytest.mark.parametrize("profile", ["compact", "classic"])
def test_a_job_of_before_there_was_a_choice_is_of_the_default_effort(profile: str) -> None:
    assert EncodingOptions.from_plain({"bits": 11, "profile": profile}) == EncodingOptions(11, profile, Effort.DEFAULT)


@pytest.mark.parametrize("effort", ["most", "", 1])
def test_an_effort_that_is_none_is_refused(effort: object) -> None:
    with pytest.raises(ValueError, match="is not a valid Effort"):
        EncodingOptions.from_plain({"bits": 11, "profile": "compact", "effort": effort})


def test_profile_classic_knows_no_effort() -> None:
    with pytest.raises(OptionError, match="effort high is of profile compact; take that, or effort default"):
        EncodingOptions(12, "classic", Effort.HIGH)


@given(CHOICES)
def test_what_is_asked_of_one_mesh_goes_before_what_holds_for_all(options: EncodingOptions) -> None:
    assert options.changed(None, None, None) == options
    assert options.changed(9, None, None) == EncodingOptions(9, options.profile, options.effort)
    assert options.changed(None, "classic", None) == EncodingOptions(options.bits, "classic")
    for effort in Effort:
        assert options.changed(None, "compact", effort) == EncodingOptions(options.bits, "compact", effort)
    with pytest.raises(OptionError, match="effort high"):
        options.changed(None, "classic", Effort.HIGH)
