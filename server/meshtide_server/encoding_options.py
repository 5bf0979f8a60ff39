"""How meshes are encoded: by a server's settings, or an upload's own; what a job keeps of either."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from meshtide_codec.effort import Effort
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Mapping

PROFILE_OF_EFFORTS = "compact"
"""The profile whose encoder can be asked for more than the default effort."""


@dataclass(frozen=True, slots=True)
class EncodingOptions:
    """How meshes are encoded here.

    Args:
        bits: B, quantization bits per coordinate.
        profile: "compact" or "classic".
        effort: whether time counts (default) or size (high); of profile compact only.

    Raises:
        OptionError: an effort that the profile does not know.
    """

    bits: int
    profile: str = "compact"
    effort: Effort = Effort.DEFAULT

    def __post_init__(self) -> None:
        if self.effort is not Effort.DEFAULT and self.profile != PROFILE_OF_EFFORTS:
            raise OptionError(
                f"effort {self.effort} is of profile {PROFILE_OF_EFFORTS}; take that, or effort {Effort.DEFAULT}"
            )

    def changed(self, bits: int | None, profile: str | None, effort: Effort | None) -> EncodingOptions:
        """These options for a mesh of which something else is asked; None where nothing was.

        An effort that was chosen for all meshes is not held against the one that is to be of another profile.

        Raises:
            OptionError: an effort that the profile does not know.

        >>> EncodingOptions(12, "compact", Effort.HIGH).changed(10, "classic", None)
        EncodingOptions(bits=10, profile='classic', effort=<Effort.DEFAULT: 'default'>)
        """
        chosen = profile or self.profile
        ours = self.effort if chosen == self.profile else Effort.DEFAULT
        return EncodingOptions(bits or self.bits, chosen, effort or ours)

    def plain(self) -> dict[str, Any]:
        """The options as values of JSON, from which `from_plain` makes them again."""
        return asdict(self) | {"effort": str(self.effort)}

    @classmethod
    def from_plain(cls, options: Mapping[str, Any]) -> EncodingOptions:
        """The options of a job; one that was queued before there was a choice of effort is of the default one.

        Raises:
            OptionError: an effort that the profile does not know.
            LookupError, TypeError, ValueError: they are none.
        """
        return cls(int(options["bits"]), str(options["profile"]), Effort(options.get("effort", Effort.DEFAULT)))
