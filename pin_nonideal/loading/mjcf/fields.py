"""Fields of MuJoCo's compiled model: converted, reported, or without effect on the motion.

The lists contain all fields of mjModel and mjOption of the version that `compile` requires; a test checks
them.
"""

from __future__ import annotations

CONVERTED_FIELDS = """
opt qpos0 qpos_spring body_parentid body_jntnum body_jntadr body_pos body_quat body_ipos body_iquat
body_mass body_inertia body_gravcomp jnt_type jnt_qposadr jnt_dofadr jnt_bodyid jnt_actuatorid jnt_limited
jnt_range jnt_pos jnt_axis jnt_stiffness jnt_stiffnesspoly jnt_actfrclimited jnt_actfrcrange jnt_actgravcomp
dof_frictionloss dof_armature dof_damping dof_dampingpoly dof_jntid geom_type geom_contype geom_conaffinity
geom_bodyid geom_dataid geom_size geom_pos geom_quat geom_friction geom_fluid site_bodyid site_pos site_quat
eq_type eq_obj1id eq_obj2id eq_objtype eq_active0 eq_data tendon_type tendon_adr tendon_num
tendon_actuatorid tendon_actfrclimited tendon_actfrcrange tendon_stiffness tendon_stiffnesspoly
tendon_damping tendon_dampingpoly tendon_frictionloss tendon_lengthspring tendon_length0 wrap_type
wrap_objid wrap_prm actuator_trntype actuator_dyntype actuator_gaintype actuator_biastype actuator_ctrladr
actuator_ctrlnum actuator_outadr actuator_actadr actuator_trnid actuator_cranklength actuator_dynprm
actuator_gainprm actuator_biasprm actuator_actlimited actuator_actrange actuator_damping
actuator_dampingpoly actuator_armature actuator_group actuator_forcelimited actuator_forcerange
actuator_ctrllimited actuator_ctrlrange actuator_gear key_qpos key_qvel key_act key_ctrl pair_geom1
pair_geom2 exclude_signature nq nv nu nactuator na nbody njnt ngeom nsite neq ntendon nkey npair nexclude
nout nwrap
"""
REPORTED_FIELDS = """
body_mocapid body_plugin jnt_plasticadr jnt_springyield tree_sleep_policy geom_plugin geom_surfacevel
geom_adhesion geom_margin geom_gap geom_condim geom_priority geom_solmix geom_solref geom_solimp jnt_solref
jnt_solimp jnt_margin dof_solref dof_solimp eq_solref eq_solimp pair_dim pair_solref pair_solreffriction
pair_solimp pair_margin pair_gap pair_adhesion pair_friction tendon_plasticadr tendon_springyield
tendon_limited tendon_range tendon_margin tendon_solref_lim tendon_solimp_lim tendon_solref_fri
tendon_solimp_fri tendon_armature actuator_actearly actuator_history actuator_delay actuator_plugin
actuator_ctrlspec actuator_actnum actuator_lengthrange actuator_acc0 sensor_plugin plugin plugin_attr
plugin_attradr plugin_stateadr plugin_statenum key_mpos key_mquat key_plastic nflex nplugin nmocap nplastic
flg_adhesion flg_surfacevel nsensor
"""
# Prefixes of fields: of flexes, which are reported as a whole, and of fields for display or measurement only.
FLEX = ("flex_", "flexedge_", "nflex", "efm0", "efmC", "nefm")
IGNORED_FIELDS = """
cam light mat mesh skin tex text tuple numeric sensor bvh oct vis stat hfield name names paths key_time
nuser nname npath ncam nlight nmat nmesh nskin ntex ntuple nnumeric nsensor nbvh noct nhfield nplugin
nhistory geom_rgba geom_group geom_matid geom_user geom_castshadow site_type site_size site_rgba site_group
site_matid site_user site_dataid tendon_rgba tendon_group tendon_matid tendon_user tendon_width body_user
jnt_user jnt_group actuator_user signature
"""
# Values that MuJoCo computes from other fields: buffer sizes, sparsity, bounds, values at the reference pose.
DERIVED_FIELDS = """
B_colind B_rowadr B_rownnz D_colind D_diag D_rowadr D_rownnz M_colind M_rowadr M_rownnz mapD2M mapM2D mapM2M
nB nC nD nJfe nJmom nJten nM narena nbuffer nconmax nemax njmax nuserdata npolygonmax ntree body_rootid
body_weldid body_dofnum body_dofadr body_treeid body_geomnum body_geomadr body_simple body_sameframe
body_subtreemass body_invweight0 body_margin body_contype body_conaffinity body_bvhadr body_bvhnum
dof_bodyid dof_parentid dof_treeid dof_Madr dof_simplenum dof_invweight0 dof_M0 dof_length tree_bodyadr
tree_bodynum tree_dofadr tree_dofnum geom_sameframe geom_aabb geom_rbound site_sameframe tendon_treenum
tendon_treeid ten_J_rownnz ten_J_rowadr ten_J_colind tendon_invweight0 actuator_outnum actuator_historyadr
actuator_length0 pair_signature flg_gravcomp ngravcomp
"""
CONVERTED_OPTIONS = "gravity wind density viscosity disableflags disableactuator"
REPORTED_OPTIONS = "enableflags o_friction o_margin o_solimp o_solref impratio cone timestep integrator"
IGNORED_OPTIONS = """
magnetic tolerance ls_tolerance noslip_tolerance ccd_tolerance sleep_tolerance jacobian solver iterations
ls_iterations noslip_iterations ccd_iterations sdf_initpoints sdf_iterations
"""


def is_listed(field: str) -> bool:
    """Check if a field of mjModel is in one of the lists."""
    listed = {*CONVERTED_FIELDS.split(), *REPORTED_FIELDS.split(), *DERIVED_FIELDS.split()}
    return field in listed or field.startswith((*FLEX, *IGNORED_FIELDS.split()))
