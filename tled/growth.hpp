#pragma once
/// Growth, swelling and shrinkage of tissue (tumour, oedema, a drug against it) as initial strain.

#include "tled/effects.hpp"
#include "tled/model.hpp"

#include <map>
#include <vector>

namespace tissuewarp::tled {

struct Grown {
    Model model;                             ///< with moduli for what has grown
    std::vector<SurfacePressure> pressures;  ///< to be added to the scene's effects
};

/// The model in which tissue of each label named wants to be larger by the stretch g (1.1: by a tenth along each axis;
/// below 1 it shrinks), F = F_e g with the elastic part F_e (Rodriguez, Hoger, McCulloch 1994, eq. 6).
///
/// For a law of an isochoric part and κ/2 (J − 1)², the energy of the grown tissue for its volume at rest, g³ W(F/g),
/// is that law with g³ times its shear moduli and κ/g³, and a constant pressure κ (1 − g⁻³) that pushes outwards: the
/// isochoric part does not see g, and κ/2 g³ (J/g³ − 1)² = κ/(2 g³) (J − 1)² − κ (1 − g⁻³) (J − 1) + a constant. A
/// constant pressure in a region is a pressure on its deformed surface, exactly so in every mesh of linear tetrahedra.
/// Growth costs nothing in an element (docs/decisions/growth.md).
///
/// Throws InvalidInput for a label without a material or tetrahedra, a stretch that is not positive and finite, or a
/// law whose energy is not of that form (lnJ, stable, Arruda–Boyce).
Grown grown(const Model& model, const std::map<int, double>& stretch);

}  // namespace tissuewarp::tled
