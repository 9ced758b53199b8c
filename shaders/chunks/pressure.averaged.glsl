// Element AveragedPressureT4. Needs: bindings, element, a law; the pressure pass has run.
// Gives: pressure_of_element, the p of f = V (P_mu + p cof F) grad N: p = ¼ Σ q_a + M U'(J), where q_a = M_a U'(J_a) are
// the nodal pressures of the four corners (kPa) and M is what the element keeps for itself.
// HAS_ELEMENT_PRESSURE is 0 where no element keeps a part.
//! define HAS_ELEMENT_PRESSURE

layout(std430, binding = BINDING_PRESSURE) readonly buffer Pressure { float pressure[]; };
layout(std430, binding = BINDING_PRESSURE_CORNERS) readonly buffer PressureCorners { uvec4 pressure_corners[]; };

float pressure_of_element(uint e, float volume_change, float volumetric_modulus) {
    uvec4 a = pressure_corners[e];
    float p = 0.25 * ((pressure[a.x] + pressure[a.y]) + (pressure[a.z] + pressure[a.w]));
#if HAS_ELEMENT_PRESSURE
    p += volumetric_modulus * volumetric_derivative(volume_change);
#endif
    return p;
}
