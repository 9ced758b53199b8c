// Needs: node; the chunks node.* of the effects whose flags are 1; the surface_force pass has run where its flag is.
// Gives: nodal_residual(a, u) = f_ext + f_spring + … - f_int (mN), constraints and contact not looked at.
//! define HAS_SPRINGS
//! define HAS_EXTERNAL_FORCE
//! define HAS_SURFACE_FORCE
//! define HAS_FLUID

vec3 nodal_residual(uint a, vec3 u) {
    vec3 residual = -gathered_force(a);
#if HAS_SPRINGS
    residual += spring_force(a, u);
#endif
#if HAS_EXTERNAL_FORCE
    residual += external_force(a);
#endif
#if HAS_SURFACE_FORCE
    residual += surface_force(a);
#endif
#if HAS_FLUID
    residual += fluid_force(a, u);
#endif
    return residual;
}
