"""Feed-forwards on a plant, in programs that several tests and inverses share."""

import dataclasses

import equinox as eqx
from elastax.control import Run, run_command


@eqx.filter_jit
def feedforward(inverse, model, reference):
    """Command of an inverse for a model."""
    return inverse.feedforward(model, reference)


_on_plant = eqx.filter_jit(run_command)


def run(plant, model, inverse, reference, controller) -> Run:
    """As `run_feedforward`, in two programs: that of the plant serves all inverses."""
    command = feedforward(inverse, model, reference)
    bare = dataclasses.replace(command, eta=command.eta[:, :0])
    return Run(command, *_on_plant(plant, bare, reference, controller))
