"""Table 6.1: path errors along a rectangle, three feed-forwards. [Reiner2010], p. 141.

The text measured a real KR16 whose parameters it does not give, along a rectangle whose
dimensions it does not print. Here the plant is the KR210 record, simulated, and the
inverse knows its parameters: the shape is reproduced, the numbers need not agree.
"""

import jax
from elastax.cli._arguments import FeedforwardConfig
from elastax.cli._motion import build_motion
from elastax.control import CascadeMotorControl, run_feedforward
from elastax.inverse import ASIM, FlexibleJointInverse, RigidInverse
from elastax.robots import kr210


PAPER = {
    "integral rlfj": 0.5744,
    "integral asim": 0.2464,
    "largest rlfj": 0.5831,
    "largest asim": 0.2528,
}


def main() -> dict[str, float]:
    """Path errors relative to the rigid feed-forward, ours beside the paper's."""
    robot = kr210()
    config = FeedforwardConfig(pose=("cannon",), path="rectangle")
    reference = build_motion(robot, config).reference
    controller = CascadeMotorControl()
    inverses = {"rigid": RigidInverse(), "rlfj": FlexibleJointInverse(), "asim": ASIM()}
    integral, largest = {}, {}
    for name, inverse in inverses.items():
        run = jax.jit(
            lambda robot, reference, inverse=inverse: (
                run_feedforward(robot, robot, inverse, reference, controller).judgement
            )
        )(robot, reference)
        integral[name] = float(run.path_error_integral)
        largest[name] = float(run.path_error_max)
    ours = {
        f"{what} {name}": figures[name] / figures["rigid"]
        for what, figures in (("integral", integral), ("largest", largest))
        for name in ("rlfj", "asim")
    }
    print(f"{'relative to rigid':<18} {'ours':>8} {'paper':>8} {'difference':>11}")
    for name, paper in PAPER.items():
        print(f"{name:<18} {ours[name]:8.4f} {paper:8.4f} {ours[name] - paper:11.4f}")
    return ours


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
