// Needs: node; node.springs and node.external_force where their flags are 1.
// Gives: nodal_residual(a, u) = f_ext + f_spring - f_int (mN), constraints not looked at.
//! define HAS_SPRINGS
//! define HAS_EXTERNAL_FORCE

vec3 nodal_residual(uint a, vec3 u) {
    vec3 residual = -gathered_force(a);
#if HAS_SPRINGS
    residual += spring_force(a, u);
#endif
#if HAS_EXTERNAL_FORCE
    residual += external_force(a);
#endif
    return residual;
}
