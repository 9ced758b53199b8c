// One invocation per element: writes its share ¼ V_e (J_e - 1) of a corner's volume change (mm³) for the averaged pressure.
// Needs: index, bindings, element.

layout(std430, binding = BINDING_VOLUME_CHANGE) writeonly buffer VolumeChange { float volume_change_share[]; };

void main() {
    uint e = first_element + invocation_index();
    if (e >= end_element) return;
    RestElement rest = rest_element(e);
    mat3 H = displacement_gradient(e, rest);
    mat3 cofactor_H = cofactor(H);
    float volume_change = trace(H) + (trace(cofactor_H) + dot(H[0], cofactor_H[0]));
    volume_change_share[e] = 0.25 * rest.volume * volume_change;
}
