"""How a guard treats every field of MjModel and mjOption, as of MuJoCo 4.0.

A test compares the table with the headers of the installed MuJoCo, so a new version cannot add a
field of a geom, flex, body, mesh or option without an entry here.
"""

from tauguard.contacts.guard.engine import PHYSICS
from tauguard.contacts.guard.followed_fields import DIMENSIONS, MOTION, PAIRS, SHAPES


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


#: The guard copies these; after an edit it reads pairs and shapes again.
FOLLOWED = frozenset((*PAIRS, *SHAPES, *MOTION, *DIMENSIONS, "opt.disableflags"))
#: Contacts depend on these. MuJoCo reads the present values in every step and sub-step, and nothing
#: that the guard keeps depends on them.
LIVE = _names(
    """
    body_margin body_pos body_quat geom_rbound geom_aabb geom_priority geom_solmix geom_solref
    geom_solimp geom_friction geom_margin geom_gap geom_surfacevel geom_adhesion geom_plugin
    pair_signature pair_solref pair_solreffriction pair_solimp pair_margin pair_gap
    pair_adhesion pair_friction flex_priority flex_solmix flex_solref flex_solimp
    flex_friction flex_margin flex_gap flex_activelayers flex_passive flex_interp flex_vert
    flex_node flex_centered flg_surfacevel flg_adhesion hfield_size hfield_data mesh_vert
    bvh_aabb oct_aabb oct_coeff opt.enableflags opt.ccd_tolerance opt.ccd_iterations
    opt.sdf_initpoints opt.sdf_iterations opt.cone opt.impratio
    """
) | {f"opt.{name}" for name in PHYSICS if name.startswith("o_")}
#: Collision depends on these, and an edit is not detected: hulls and trees of a mesh, a flex or a
#: body, which the compiler makes together.
COMPILED = _names(
    """
    mesh_normal mesh_face mesh_facenormal mesh_graph mesh_scale mesh_pos mesh_quat
    mesh_extrema mesh_polynormal mesh_polyvert mesh_polymap bvh_depth bvh_child bvh_nodeid
    oct_depth oct_child hfield_ncol flex_edge flex_edgeflap flex_elemedge flex_elemlayer
    flex_shell flex_matid geom_matid flex_vertcell
    """
)
#: Fields of the same objects and options that collision does not depend on, or only by the motion.
OTHER = _names(
    """
    body_simple body_mass body_subtreemass body_inertia body_invweight0 body_gravcomp
    body_user body_plugin body_sameframe geom_group geom_castshadow geom_fluid geom_user
    geom_rgba flex_group flex_plasticmode flex_elemtexcoord flex_vert0 flex_node0 flex_size
    flex_bending flex_damping flex_yield flex_edgestiffness flex_edgedamping flex_edgeequality
    flex_flatskin flex_rgba flex_texcoord flexedge_invweight0 flexedge_rigid flexedge_J_rownnz
    flexedge_J_rowadr flexedge_J_colind mesh_texcoord mesh_facetexcoord flg_gravcomp
    opt.timestep opt.tolerance opt.ls_tolerance opt.noslip_tolerance opt.sleep_tolerance
    opt.gravity opt.wind opt.magnetic opt.density opt.viscosity opt.integrator opt.jacobian
    opt.solver opt.iterations opt.ls_iterations opt.noslip_iterations opt.disableactuator
    """
)
#: Other objects, by the first part of their fields' names, and sizes.
OTHER_OBJECTS = (
    "(jnt|dof|tree|site|cam|light|skin|tex|mat|eq|tendon|ten|wrap|actuator|sensor|plugin|numeric|text"
    "|tuple|key|name|efm0|B|M|D|qpos)_.*|qpos0|efmC.*|map[MD]2[MD]|names(_map)?|paths|opt|vis|stat"
    "|buffer|signature|plugin|n[A-Za-z0-9_]+"
)
