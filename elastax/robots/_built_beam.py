"""Modal beams of records: built in one program, which takes half of the time."""

import equinox as eqx

from ..structure import ModalBody, ModeCounts, TipMass, UniformBeam, modal_beam


def built_beam(
    beam: UniformBeam, counts: ModeCounts, tip: TipMass | None = None, **options
) -> ModalBody:
    """`modal_beam`, compiled; options are numbers that are known."""
    build = lambda beam, tip: modal_beam(beam, counts, tip=tip, **options)
    return eqx.filter_jit(build)(beam, tip)
