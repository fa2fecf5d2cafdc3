"""What of a URDF is left out, and the warning that tells it."""

from ._urdf_file import UrdfFile


# tags beside links and joints, and inside joints, that mean nothing to a chain
_BESIDE = ("transmission", "gazebo", "ros2_control", "sensor")
_INSIDE = ("safety_controller", "calibration")


class UrdfWarning(UserWarning):
    """What of a URDF was left out, put in, or looks wrong; one for the whole file.

    Attributes:
        label: the file.
        notes: one line each.
    """

    @property
    def label(self) -> str:
        return self.args[0]

    @property
    def notes(self) -> tuple[str, ...]:
        return self.args[1]

    def __str__(self) -> str:
        return "\n  - ".join([f"{self.label}, left out or doubtful:", *self.notes])


def left_out(file: UrdfFile, path: list) -> list[str]:
    """What of the file a chain does not show.

    Args:
        file: the URDF.
        path: records of the chain's joints, from the base to the tip.
    """
    notes = []
    moving = [joint for joint in path if joint.type != "fixed"]
    on_path = {joint.name for joint in path}
    # a base that was named may lie behind joints
    on_path |= {joint.name for joint in _above(file, path[0].parent)}
    for joint in file.robot.joints:
        if joint.name in on_path or joint.type == "fixed":
            continue
        if not any(
            a.type != "fixed" and a.name not in on_path
            for a in _above(file, joint.parent)
        ):
            notes.append(
                f"{file.where('joint', joint.name)} starts a branch, which was left "
                f"out with its mass: {', '.join(_behind(file, joint))}"
            )
    for joint in moving:
        if joint.mimic is not None:
            notes.append(
                f"{file.where('joint', joint.name)} mimics `{joint.mimic.joint}`, but "
                "moves on its own here"
            )
    notes += _tags(file, moving)
    return notes


def _above(file: UrdfFile, link: str) -> list:
    """Joints between the root and a link."""
    for joint in file.robot.joints:
        if joint.child == link:
            return [*_above(file, joint.parent), joint]
    return []


def _behind(file: UrdfFile, joint) -> list[str]:
    found = [joint.child]
    for other in file.robot.joints:
        if other.parent == joint.child:
            found += _behind(file, other)
    return found


def _rubs(dynamics) -> bool:
    return dynamics is not None and any(
        float(value or 0) for value in (dynamics.damping, dynamics.friction)
    )


def _tags(file: UrdfFile, moving: list) -> list[str]:
    """Counts of the tags that mean nothing to a chain."""
    notes = []
    rubbing = [joint.name for joint in moving if _rubs(joint.dynamics)]
    if rubbing:
        notes.append(
            f"<dynamics> of {', '.join(rubbing)}: damping and friction are those of "
            "the file beside the URDF"
        )
    if any(joint.limit is not None and joint.limit.effort for joint in moving):
        notes.append("`effort` limits: an arm has no limits of torque")
    counts = {tag: len(list(file.root.iter(tag))) for tag in (*_BESIDE, *_INSIDE)}
    counts |= {tag: len(list(file.root.iter(tag))) for tag in ("visual", "collision")}
    meshes = len(list(file.root.iter("mesh")))
    shown = [f"{count} <{tag}>" for tag, count in counts.items() if count]
    if shown:
        mesh = f" (with {meshes} meshes, never loaded)" if meshes else ""
        notes.append(f"not read: {', '.join(shown)}{mesh}")
    return notes
