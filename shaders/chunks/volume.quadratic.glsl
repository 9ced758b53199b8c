// Gives: volumetric_derivative, U'(J) = J - 1 of U = (J - 1)²/2 from J - 1; J <= 0 is a volume like any other.

float volumetric_derivative(float volume_change) { return volume_change; }
