// Element T4. Needs: patch, a law.
// Gives: Pressure, that of a tetrahedron of a fan: p = M U'(J) of the tetrahedron itself (kPa).

struct Pressure {
    float modulus;
};

Pressure first_pressure(Patch here, uint a, uint b, uint c) { return Pressure(here.volumetric_modulus); }
void take_next_node(inout Pressure pressure, uint d) {}
float pressure_of(Pressure pressure, float volume_change) {
    return pressure.modulus * volumetric_derivative(volume_change);
}
