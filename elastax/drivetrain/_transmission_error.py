"""stub"""

import equinox as eqx


class TransmissionError(eqx.Module):
    def output_angle(self, theta):
        return theta

    def motor_angle(self, angle):
        return angle
