"""Random scenes of bodies, flexes and machines, by family, and edits between their steps."""

from scenes import machines, rigid, soft

#: What draws a scene of each family, in the order that seeds follow: a new family comes last.
FAMILIES = {
    draw.__name__: draw
    for draw in (
        *(rigid.plate, rigid.pair, rigid.chain, rigid.cup, rigid.arm, soft.cloth),
        *(rigid.composite, rigid.stack, rigid.joined, rigid.spin, soft.soft, rigid.mill),
        *(rigid.grid, rigid.small, rigid.door, rigid.servo, rigid.whips, rigid.paddle),
        *(rigid.squeeze, soft.needles, machines.gears, machines.screw, machines.tendons),
        *(machines.block, machines.sheets, machines.terrain, machines.distance_field),
        *(machines.crowd, machines.breaking, machines.hand, machines.belt, machines.wind),
        *(machines.piston, machines.tools, machines.gripper, machines.solids),
    )
}
