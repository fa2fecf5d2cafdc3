"""Exudyn's planar beam of absolute nodal coordinates, as a peer of modal bodies."""

import exudyn
import numpy as np
from exudyn.beams import GenerateStraightLineANCFCable2D
from exudyn.itemInterface import Cable2D, ObjectGround, SensorNode


# node coordinates: x, y, and their two slopes along the beam
CLAMPED, PINNED = [1, 1, 0, 1], [1, 1, 0, 0]


class PlanarBeam:
    """A beam along x from the origin, in the x-y plane.

    Args:
        length: [m].
        mass_per_length: [kg/m].
        bending, axial: stiffnesses EI [N m^2] and EA [N].
        elements: number of elements.
        base: constraints of the first node, `CLAMPED` or `PINNED`.
        gravity: along y [m/s^2].
    """

    def __init__(
        self, length, mass_per_length, bending, axial, elements, base, gravity=0.0
    ):
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.system.AddObject(ObjectGround())
        cable = Cable2D(
            physicsMassPerLength=mass_per_length,
            physicsBendingStiffness=bending,
            physicsAxialStiffness=axial,
        )
        self.nodes = GenerateStraightLineANCFCable2D(
            self.system,
            positionOfNode0=[0.0, 0.0, 0.0],
            positionOfNode1=[length, 0.0, 0.0],
            numberOfElements=elements,
            cableTemplate=cable,
            massProportionalLoad=[0.0, gravity, 0.0],
            fixedConstraintsNode0=base,
        )[0]
        self.fixed = [k for k, held in enumerate(base) if held]
        self.sensor = self.system.AddSensor(
            SensorNode(
                nodeNumber=self.nodes[-1],
                storeInternal=True,
                outputVariableType=exudyn.OutputVariableType.Position,
            )
        )
        self.system.Assemble()

    def frequencies(self, number: int) -> np.ndarray:
        """Lowest eigenfrequencies at rest [Hz]."""
        squares, _ = self.system.ComputeODE2Eigenvalues(
            ignoreAlgebraicEquations=True, constrainedCoordinates=self.fixed
        )
        return np.sqrt(np.abs(np.sort(squares)[:number])) / (2 * np.pi)

    def swing(self, duration: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Times and positions of the tip, shape (times, 2), released at rest."""
        settings = exudyn.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = duration
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
        # its rounding of the stiff axis keeps Newton from the default of 1e-8
        settings.timeIntegration.newton.relativeTolerance = 1e-6
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = duration / 500
        settings.timeIntegration.verboseMode = 0
        self.system.SolveDynamic(settings)
        data = np.asarray(self.system.GetSensorStoredData(self.sensor))
        return data[:, 0], data[:, 1:3]
