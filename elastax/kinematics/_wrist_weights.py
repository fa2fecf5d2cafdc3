"""How two aligned wrist axes share a turn that only one combination of them fixes."""

import equinox as eqx
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


class WristWeights(eqx.Module):
    r"""Weights of the axes 4 and 6 where the two are aligned.

    There the tool fixes $\theta_4 + \theta_6$ alone, or $\theta_4 - \theta_6$ with
    axis 5 half a turn away. Of all pairs the one with the smallest
    $a\,\delta_4^2 + b\,\delta_6^2$ is taken, the changes counted from the last angles.

    Attributes:
        axis_4: a >= 0, how dear a change of axis 4 is [-].
        axis_6: b >= 0, how dear a change of axis 6 is [-]; not both are zero.

    References:
        [Berns], singular configuration.
    """

    axis_4: Scalar = eqx.field(converter=as_real)
    axis_6: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values("`axis_4` must not be negative", self.axis_4, self.axis_4 >= 0)
        check_values("`axis_6` must not be negative", self.axis_6, self.axis_6 >= 0)
        total = self.axis_4 + self.axis_6
        check_values("the weights must not both be zero: the sum", total, total > 0)

    def shares(
        self, change: Float[Array, "*shape"]
    ) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"]]:
        r"""Changes of the axes 4 and 6 that add up to `change` [rad].

        $\delta_4 = bD/(a+b)$, $\delta_6 = aD/(a+b)$: the weights cross. Where the
        difference $\delta_4 - \delta_6 = D$ is fixed, the second share changes its
        sign.
        """
        total = self.axis_4 + self.axis_6
        return self.axis_6 / total * change, self.axis_4 / total * change
