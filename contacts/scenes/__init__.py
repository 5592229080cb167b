"""Small scenes whose contacts are hard to find."""

from collections.abc import Callable

from tauguard.contacts.scenes.arms import arm_boxes, two_arms
from tauguard.contacts.scenes.fabrics import arm_cloth, garment_chest, sleeve_arm
from tauguard.contacts.scenes.impacts import ball_cloth, sphere_plate
from tauguard.contacts.scenes.scene import ContactScene, Control

#: Scene builders by name; each builder has defaults for all its arguments.
SCENES: dict[str, Callable[..., ContactScene]] = {
    build.__name__: build
    for build in (
        arm_cloth,
        sleeve_arm,
        garment_chest,
        ball_cloth,
        sphere_plate,
        arm_boxes,
        two_arms,
    )
}

__all__ = [
    "SCENES", "ContactScene", "Control", "arm_boxes", "arm_cloth", "ball_cloth", "garment_chest",
    "sleeve_arm", "sphere_plate", "two_arms",
]  # fmt: skip
