"""How the base of a beam is held; its other end is free or carries a mass."""

import abc

import equinox as eqx


class AbstractSupport(eqx.Module):
    """What the base of a beam cannot do."""

    @property
    @abc.abstractmethod
    def holds_deflection(self) -> bool:
        """Whether the base stays in place."""

    @property
    @abc.abstractmethod
    def holds_slope(self) -> bool:
        """Whether the base cannot turn in bending."""

    @property
    @abc.abstractmethod
    def rigid_modes(self) -> int:
        """Number of rigid-body motions in one plane, which are no modes here."""


class ClampedFree(AbstractSupport):
    """Clamped at the base, $u = u' = 0$."""

    @property
    def holds_deflection(self) -> bool:
        return True

    @property
    def holds_slope(self) -> bool:
        return True

    @property
    def rigid_modes(self) -> int:
        return 0


class SupportedFree(AbstractSupport):
    """Hinged at the base, $u = u'' = 0$; its rotation as a whole is no mode."""

    @property
    def holds_deflection(self) -> bool:
        return True

    @property
    def holds_slope(self) -> bool:
        return False

    @property
    def rigid_modes(self) -> int:
        return 1


class FreeFree(AbstractSupport):
    """Free at the base too; neither of its rigid motions is a mode."""

    @property
    def holds_deflection(self) -> bool:
        return False

    @property
    def holds_slope(self) -> bool:
        return False

    @property
    def rigid_modes(self) -> int:
        return 2
