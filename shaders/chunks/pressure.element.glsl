// Element T4. Needs: element, a law.
// Gives: pressure_of_element, the p of f = V (P_mu + p cof F) grad N: p = M U'(J) of the element itself (kPa).

float pressure_of_element(uint e, float volume_change, float volumetric_modulus) {
    return volumetric_modulus * volumetric_derivative(volume_change);
}
