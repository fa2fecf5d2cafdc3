"""How much of the coupled equations of a modal body is kept."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class BodyDetail:
    r"""Which terms of (3.72) a modal body has, to which order in its deformation.

    Less than `NOMINAL` are equations that no energy belongs to: they are for inverse
    models, whose zero dynamics they make stable, not for plants.

    Attributes:
        coupling: order of $C_t$ and $C_r$ in the inertia; `None` leaves them out, and
            with them the reaction of the deformation on the carrier.
        modal_gravity: order of $C_t$ in the weight on the modes, part of $h_e$; `None`
            leaves it out.
        gyroscopic: whether $G_r$ and $G_e$ are kept.
        centrifugal: order of $O_e$, 0 or 1.
        inertia: order of $J$ and $d_{CM}$, 0 or 2.

    Raises:
        ValueError: an order that there is not.

    References:
        [Reiner2010] (3.72), (3.73) and the five variants of section 3.7.
    """

    coupling: int | None = 1
    modal_gravity: int | None = 1
    gyroscopic: bool = True
    centrifugal: int = 1
    inertia: int = 2

    def __post_init__(self):
        for name, orders in (
            ("coupling", (None, 0, 1)),
            ("modal_gravity", (None, 0, 1)),
            ("centrifugal", (0, 1)),
            ("inertia", (0, 2)),
        ):
            if getattr(self, name) not in orders:
                raise ValueError(
                    f"`{name}` must be one of {orders}, but is {getattr(self, name)}"
                )

    @property
    def separates_gravity(self) -> bool:
        """Whether weight acts on the modes otherwise than acceleration does."""
        return self.coupling != self.modal_gravity

    @property
    def is_nominal(self) -> bool:
        """Whether nothing is left out."""
        return self == NOMINAL


NOMINAL = BodyDetail()
# (3.73): the rigid body alone moves the carrier, and the modes follow it
VARIANT_1 = BodyDetail(
    coupling=None, modal_gravity=None, gyroscopic=False, centrifugal=0, inertia=0
)
VARIANT_2 = BodyDetail(
    coupling=None, modal_gravity=None, gyroscopic=False, centrifugal=0
)
VARIANT_3 = BodyDetail(coupling=None, modal_gravity=None)
VARIANT_4 = BodyDetail(coupling=None)
VARIANT_5 = BodyDetail(coupling=0, modal_gravity=0)
# by the names of the text
BODY_DETAILS = {
    "nominal": NOMINAL,
    "variant 1": VARIANT_1,
    "variant 2": VARIANT_2,
    "variant 3": VARIANT_3,
    "variant 4": VARIANT_4,
    "variant 5": VARIANT_5,
}
